// For encodings that write a frame as one chunk.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace deform {

// Copies `bytes`, `what` ("a pose"), to where a chunk goes, and returns how
// many they are. FailedPrecondition FRAME_TOO_LARGE if a chunk does not hold
// them.
absl::StatusOr<int64_t> PutInOneChunk(absl::string_view what,
                                      std::span<const uint8_t> bytes,
                                      uint8_t* out);

}  // namespace deform
