#include "core/frames/encodings/float32.h"

#include <algorithm>
#include <bit>

#include "absl/strings/str_cat.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "frames are copied as they lie in memory");

class Float32 final : public FrameEncoding {
 public:
  absl::string_view id() const override { return "float32"; }
  bool is_exact() const override { return true; }
  bool is_verbatim() const override { return true; }
  double FinestTolerance(double /*reach*/) const override { return 0; }

  int64_t PointsPerChunk(int dimension) const override {
    return kMaxChunkBytes / (dimension * int64_t{sizeof(float)});
  }

  absl::StatusOr<int64_t> Encode(const ChunkSource& source,
                                 uint8_t* out) const override {
    const auto* const bytes =
        reinterpret_cast<const uint8_t*>(source.positions.data());
    // Not memcpy: an empty span may have no address.
    if (bytes != out) std::copy_n(bytes, source.positions.size_bytes(), out);
    return static_cast<int64_t>(source.positions.size_bytes());
  }

  absl::Status Decode(std::span<const uint8_t> bytes,
                      const ChunkTarget& target) const override {
    if (bytes.size() != target.positions.size_bytes()) {
      return BadFrameData(absl::StrCat("chunk has ", bytes.size(),
                                       " bytes, its vertices need ",
                                       target.positions.size_bytes()));
    }
    std::copy_n(bytes.data(), bytes.size(),
                reinterpret_cast<uint8_t*>(target.positions.data()));
    return absl::OkStatus();
  }
};

}  // namespace

const FrameEncoding& Float32Encoding() {
  static const Float32 encoding;
  return encoding;
}

}  // namespace deform
