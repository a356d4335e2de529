// Frames as Protobuf messages whose bytes are not copied.
#pragma once

#include <cstdint>
#include <memory>

#include "grpcpp/support/byte_buffer.h"
#include "server/sessions/frame.h"
#include "server/sessions/outbox.h"

namespace deform::server {

// DeformResponse{frame} with chunk `chunk` of the frame: a header of our own,
// written for this receiver, then the frame's bytes where they lie. `data` is
// the last field, so both together are one valid message. The buffer keeps the
// frame alive until gRPC has sent it.
grpc::ByteBuffer FrameMessage(const FrameToSend& send, size_t chunk,
                              uint64_t epoch, uint64_t durable_revision);

// DeformResponse{point_order}, likewise: message `part` of OrderMessages().
size_t OrderMessages(const PointOrder& order);
grpc::ByteBuffer OrderMessage(const std::shared_ptr<const PointOrder>& order,
                              size_t part);

}  // namespace deform::server
