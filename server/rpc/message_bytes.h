// Protobuf messages in gRPC's buffers, for calls that handle bytes themselves.
#pragma once

#include "google/protobuf/message_lite.h"
#include "grpcpp/support/byte_buffer.h"

namespace deform::server {

// False if `bytes` are no message of this kind. Copies at most once.
bool ParseMessage(const grpc::ByteBuffer& bytes,
                  google::protobuf::MessageLite& message);

grpc::ByteBuffer SerializeMessage(const google::protobuf::MessageLite& message);

}  // namespace deform::server
