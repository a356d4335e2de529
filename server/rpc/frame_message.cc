#include "server/rpc/frame_message.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/frames/normals.h"
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
  if (send.tells_basis) header.set_basis_id(frame.info.basis_id);
  header.set_durable_revision(durable_revision);
  header.set_skipped_revisions(send.skipped_revisions);
  header.set_columns_applied(Clamped(frame.info.columns_applied));
  header.set_exit_mismatch(frame.info.exit_mismatch);
  header.set_deform_us(Clamped(frame.info.deform_time.count()));
  if (frame.encoding->uses_grid()) header.set_step(frame.held->step);
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

// A field of bytes that is not copied.
struct BytesField {
  uint32_t number;
  const void* data;
  int64_t size;
  std::shared_ptr<const void> keep;
};

grpc::Slice SliceOf(BytesField field) {
  using Kept = std::shared_ptr<const void>;
  return grpc::Slice(
      const_cast<void*>(field.data), field.size,
      [](void* kept) { delete static_cast<Kept*>(kept); },
      new Kept(std::move(field.keep)));
}

// The message of field `field` whose first fields are `inner`, and whose last
// are `bytes`, at least one.
grpc::ByteBuffer MessageAround(uint32_t field, const std::string& inner,
                               std::vector<BytesField> bytes) {
  std::vector<std::string> tags;
  size_t size = inner.size();
  for (const BytesField& one : bytes) {
    AppendTag(one.number, one.size, tags.emplace_back());
    size += tags.back().size() + one.size;
  }
  std::string header;
  AppendTag(field, size, header);
  tags.front().insert(0, header + inner);
  std::vector<grpc::Slice> slices;
  for (size_t i = 0; i < bytes.size(); ++i) {
    slices.emplace_back(tags[i]);
    slices.push_back(SliceOf(std::move(bytes[i])));
  }
  return {slices.data(), slices.size()};
}

}  // namespace

grpc::ByteBuffer FrameMessage(const FrameToSend& send, size_t chunk,
                              uint64_t epoch, uint64_t durable_revision) {
  const Frame::Chunk& part = send.frame->chunks[chunk];
  std::vector<BytesField> bytes;
  if (send.normals != nullptr) {
    bytes.push_back({v1::FrameChunk::kNormalsFieldNumber,
                     send.normals->data() + kNormalBytes * part.first_vertex,
                     kNormalBytes * part.vertex_count, send.normals});
  }
  bytes.push_back({v1::FrameChunk::kDataFieldNumber, part.bytes.get(),
                   part.size, send.frame});
  return MessageAround(
      v1::DeformResponse::kFrameFieldNumber,
      ChunkHeader(send, chunk, epoch, durable_revision).SerializeAsString(),
      std::move(bytes));
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
      {{v1::PointOrderChunk::kDataFieldNumber, order->points().data() + first,
        count * int64_t{sizeof(int32_t)}, order}});
}

}  // namespace deform::server
