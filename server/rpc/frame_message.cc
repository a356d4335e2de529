#include "server/rpc/frame_message.h"

#include <algorithm>
#include <limits>
#include <string>

#include "deform/v1/session.pb.h"
#include "google/protobuf/io/coded_stream.h"
#include "grpcpp/support/slice.h"

namespace deform::server {
namespace {

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
  header.set_keyframe(send.keyframe);
  header.set_first_vertex(chunk.first_vertex);
  header.set_vertex_count(chunk.vertex_count);
  header.set_last(index + 1 == frame.chunks.size());
  if (index > 0) return header;
  if (send.keyframe) {
    for (int c = 0; c < frame.dimension; ++c) {
      header.add_origin(frame.info.origin[c]);
    }
  }
  header.set_durable_revision(durable_revision);
  header.set_skipped_revisions(send.skipped_revisions);
  header.set_columns_applied(Clamped(frame.info.columns_applied));
  header.set_exit_mismatch(frame.info.exit_mismatch);
  header.set_deform_us(Clamped(frame.info.deform_time.count()));
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

}  // namespace

grpc::ByteBuffer FrameMessage(const FrameToSend& send, size_t chunk,
                              uint64_t epoch, uint64_t durable_revision) {
  const Frame::Chunk& data = send.frame->chunks[chunk];
  std::string inner =
      ChunkHeader(send, chunk, epoch, durable_revision).SerializeAsString();
  AppendTag(v1::FrameChunk::kDataFieldNumber, data.size, inner);
  std::string header;
  AppendTag(v1::DeformResponse::kFrameFieldNumber, inner.size() + data.size,
            header);
  header += inner;
  auto* keep = new std::shared_ptr<const Frame>(send.frame);
  const grpc::Slice slices[2] = {
      grpc::Slice(header),
      grpc::Slice(
          data.bytes.get(), data.size,
          [](void* kept) {
            delete static_cast<std::shared_ptr<const Frame>*>(kept);
          },
          keep)};
  return grpc::ByteBuffer(slices, 2);
}

}  // namespace deform::server
