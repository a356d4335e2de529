// The seam for frame encodings: how deformed vertices become bytes, and back.
//
// To add one: write encodings/<name>.cc, then add one line to
// builtin_encodings.cc. Server and C++ client share both directions.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace deform {

// Chunks of a frame hold at most this many bytes.
inline constexpr int64_t kMaxChunkBytes = int64_t{1} << 20;

class FrameEncoding {
 public:
  virtual ~FrameEncoding() = default;

  // Name on the wire; it never changes meaning.
  virtual absl::string_view id() const = 0;

  // Vertices of `dimension` coordinates that a chunk holds at most.
  virtual int64_t VerticesPerChunk(int dimension) const = 0;

  // Writes consecutive vertices, given relative to the frame's origin
  // (dimension floats each), to `out`, which holds kMaxChunkBytes. Returns the
  // bytes written.
  virtual int64_t Encode(std::span<const float> positions, int dimension,
                         uint8_t* out) const = 0;

  // The reverse. `bytes` come from outside: InvalidArgument (BAD_FRAME) if they
  // are not what Encode writes for positions.size() numbers.
  virtual absl::Status Decode(std::span<const uint8_t> bytes, int dimension,
                              std::span<float> positions) const = 0;
};

std::span<const FrameEncoding* const> AllEncodings();

// Null if there is none of this name.
const FrameEncoding* FindEncoding(absl::string_view id);

}  // namespace deform
