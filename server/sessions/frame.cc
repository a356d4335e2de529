#include "server/sessions/frame.h"

#include <algorithm>
#include <cassert>
#include <cstring>

namespace deform::server {
namespace {

// An encoding may write up to a whole chunk whatever it returns, so it writes
// here first and the frame keeps what it needs.
struct Scratch {
  std::vector<float> positions;
  std::vector<uint8_t> bytes;
};

Frame::Chunk EncodeChunk(const Deformer& deformer,
                         const FrameEncoding& encoding, const Vec3& origin,
                         int64_t first, int64_t count) {
  static thread_local Scratch scratch;
  const int dimension = deformer.binding().dimension();
  scratch.positions.resize(count * dimension);
  scratch.bytes.resize(kMaxChunkBytes);
  deformer.CopyRelative(first, count, origin, scratch.positions.data());
  Frame::Chunk chunk{.first_vertex = first, .vertex_count = count};
  const absl::StatusOr<int64_t> size =
      encoding.Encode({.dimension = dimension,
                       .first = first,
                       .count = count,
                       .positions = scratch.positions},
                      scratch.bytes.data());
  assert(size.ok());  // Exact encodings take everything.
  chunk.size = *size;
  chunk.bytes = std::make_unique_for_overwrite<uint8_t[]>(chunk.size);
  std::memcpy(chunk.bytes.get(), scratch.bytes.data(), chunk.size);
  return chunk;
}

}  // namespace

std::shared_ptr<const Frame> EncodeFrame(const Deformer& deformer,
                                         const FrameEncoding& encoding,
                                         const FrameInfo& info,
                                         ThreadPool* pool) {
  assert(encoding.is_exact());
  const int64_t points = deformer.binding().point_count();
  auto frame = std::make_shared<Frame>();
  frame->info = info;
  frame->dimension = deformer.binding().dimension();
  frame->encoding = &encoding;
  const int64_t per_chunk = encoding.PointsPerChunk(frame->dimension);
  const int64_t chunks = (points + per_chunk - 1) / per_chunk;
  frame->chunks.resize(chunks);
  const auto encode = [&](int64_t i) {
    const int64_t first = i * per_chunk;
    frame->chunks[i] = EncodeChunk(deformer, encoding, info.origin, first,
                                   std::min(per_chunk, points - first));
  };
  if (pool == nullptr || chunks == 1) {
    for (int64_t i = 0; i < chunks; ++i) encode(i);
  } else {
    pool->ParallelFor(chunks, nullptr, encode);
  }
  return frame;
}

}  // namespace deform::server
