#include "core/frames/encodings/one_chunk.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/frames/encoding.h"

namespace deform {

absl::StatusOr<int64_t> PutInOneChunk(absl::string_view what,
                                      std::span<const uint8_t> bytes,
                                      uint8_t* out) {
  if (std::ssize(bytes) > kMaxChunkBytes) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     absl::StrCat(what, " takes ", bytes.size(),
                                  " bytes, a chunk at most ", kMaxChunkBytes),
                     {.reason = "FRAME_TOO_LARGE"});
  }
  std::copy(bytes.begin(), bytes.end(), out);
  return std::ssize(bytes);
}

}  // namespace deform
