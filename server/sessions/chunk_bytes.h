// Memory of frames' chunks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace deform::server {

// Gives memory back: to who keeps it for the chunks that follow, if it came
// from there.
struct ReturnBytes {
  ReturnBytes() = default;
  // Of std::make_unique().
  ReturnBytes(std::default_delete<uint8_t[]> /*plain*/) {}  // NOLINT

  void operator()(uint8_t* bytes) const;

  bool kept = false;
};
using ChunkBytes = std::unique_ptr<uint8_t[], ReturnBytes>;

// kMaxChunkBytes, with whatever was in it, to be encoded into. Up to
// kMostBytesKept of this memory is kept in the process when it is given back:
// what comes from the system is paid by the page, for a frame of floats as much
// as for filling it. Thread-safe.
ChunkBytes TakeChunkBytes();

inline constexpr size_t kMostBytesKept = size_t{64} << 20;

}  // namespace deform::server
