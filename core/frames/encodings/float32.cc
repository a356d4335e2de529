// Encoding "float32": little-endian float32, `dimension` per vertex.
#include <algorithm>
#include <bit>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/frames/encoding.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "frames are copied as they lie in memory");

class Float32 final : public FrameEncoding {
 public:
  absl::string_view id() const override { return "float32"; }

  int64_t VerticesPerChunk(int dimension) const override {
    return kMaxChunkBytes / (dimension * int64_t{sizeof(float)});
  }

  int64_t Encode(std::span<const float> positions, int /*dimension*/,
                 uint8_t* out) const override {
    // Not memcpy: an empty span may have no address.
    std::copy_n(reinterpret_cast<const uint8_t*>(positions.data()),
                positions.size_bytes(), out);
    return static_cast<int64_t>(positions.size_bytes());
  }

  absl::Status Decode(std::span<const uint8_t> bytes, int /*dimension*/,
                      std::span<float> positions) const override {
    if (bytes.size() != positions.size_bytes()) {
      return InvalidInput(
          "BAD_FRAME", "frame.data",
          absl::StrCat("chunk has ", bytes.size(), " bytes, its vertices need ",
                       positions.size_bytes()));
    }
    std::copy_n(bytes.data(), bytes.size(),
                reinterpret_cast<uint8_t*>(positions.data()));
    return absl::OkStatus();
  }
};

}  // namespace

const FrameEncoding& Float32Encoding() {
  static const Float32 encoding;
  return encoding;
}

}  // namespace deform
