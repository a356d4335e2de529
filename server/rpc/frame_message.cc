#include "server/rpc/frame_message.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>
#include <utility>

#include "deform/v1/session.pb.h"
#include "google/protobuf/io/coded_stream.h"
#include "grpcpp/support/slice.h"

namespace deform::server {
namespace {

static_assert(std::endian::native == std::endian::little,
              "orders are sent as they lie in memory");

constexpr int64_t kPointsPerMessage = kMaxChunkBytes / sizeof(int32_t);

template <typename Integer>
uint32_t Clamped(Integer value) {
  return static_cast<uint32_t>(
      std::clamp<Integer>(value, 0, std::numeric_limits<uint32_t>::max()));
}

// The chunk without its data.
v1::FrameChunk ChunkHeader(const FrameToSend& send, size_t index,
                           uint64_t epoch, uint64_t durable_revision) {
  const Frame& frame = *send.frame;
  const Frame::Chunk& chunk = frame.chunks[index];
  v1::FrameChunk header;
  header.set_revision(frame.info.revision);
  header.set_epoch(epoch);
  header.set_answers_sequence(send.answers_sequence);
  header.set_encoding(std::string(frame.encoding->id()));
  header.set_keyframe(!frame.reference_revision);
  if (frame.reference_revision) {
    header.set_reference_revision(*frame.reference_revision);
  }
  header.set_first_vertex(chunk.first_vertex);
  header.set_vertex_count(chunk.vertex_count);
  header.set_last(index + 1 == frame.chunks.size());
  if (index > 0) return header;
  if (send.tells_origin) {
    for (int c = 0; c < frame.dimension; ++c) {
      header.add_origin(frame.info.origin[c]);
    }
  }
  header.set_durable_revision(durable_revision);
  header.set_skipped_revisions(send.skipped_revisions);
  header.set_columns_applied(Clamped(frame.info.columns_applied));
  header.set_exit_mismatch(frame.info.exit_mismatch);
  header.set_deform_us(Clamped(frame.info.deform_time.count()));
  if (frame.grid != nullptr) header.set_step(frame.grid->step);
  header.set_error_bound(frame.error_bound);
  return header;
}

// Tag and length of a field of bytes or of a message.
void AppendTag(uint32_t field, size_t length, std::string& out) {
  google::protobuf::io::StringOutputStream stream(&out);
  google::protobuf::io::CodedOutputStream coded(&stream);
  constexpr uint32_t kLengthDelimited = 2;
  coded.WriteTag(field << 3 | kLengthDelimited);
  coded.WriteVarint32(static_cast<uint32_t>(length));
}

// The message of field `field` whose first fields are `inner`, and whose last
// is `data`, field `data_field`, which is not copied and is kept by `keep`.
template <typename Kept>
grpc::ByteBuffer MessageAround(uint32_t field, std::string inner,
                               uint32_t data_field, const void* data,
                               int64_t size, std::shared_ptr<Kept> keep) {
  AppendTag(data_field, size, inner);
  std::string header;
  AppendTag(field, inner.size() + size, header);
  header += inner;
  const grpc::Slice slices[2] = {
      grpc::Slice(header),
      grpc::Slice(
          const_cast<void*>(data), size,
          [](void* kept) { delete static_cast<std::shared_ptr<Kept>*>(kept); },
          new std::shared_ptr<Kept>(std::move(keep)))};
  return grpc::ByteBuffer(slices, 2);
}

}  // namespace

grpc::ByteBuffer FrameMessage(const FrameToSend& send, size_t chunk,
                              uint64_t epoch, uint64_t durable_revision) {
  const Frame::Chunk& data = send.frame->chunks[chunk];
  return MessageAround(
      v1::DeformResponse::kFrameFieldNumber,
      ChunkHeader(send, chunk, epoch, durable_revision).SerializeAsString(),
      v1::FrameChunk::kDataFieldNumber, data.bytes.get(), data.size,
      send.frame);
}

size_t OrderMessages(const PointOrder& order) {
  return (order.size() + kPointsPerMessage - 1) / kPointsPerMessage;
}

grpc::ByteBuffer OrderMessage(const std::shared_ptr<const PointOrder>& order,
                              size_t part) {
  const int64_t first = static_cast<int64_t>(part) * kPointsPerMessage;
  const int64_t count = std::min(kPointsPerMessage, order->size() - first);
  v1::PointOrderChunk header;
  header.set_first(first);
  return MessageAround(
      v1::DeformResponse::kPointOrderFieldNumber, header.SerializeAsString(),
      v1::PointOrderChunk::kDataFieldNumber, order->points().data() + first,
      count * int64_t{sizeof(int32_t)}, order);
}

}  // namespace deform::server
