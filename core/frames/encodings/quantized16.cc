#include "core/frames/encodings/quantized16.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "numbers are copied as they lie in memory");

constexpr double kLargest = 65535;
constexpr int64_t kSideBytes = 2 * sizeof(double);

// One coordinate of a box, cut into steps.
struct Side {
  double min = 0;
  double step = 0;

  // How far a coordinate may come out from where it was: half a step, and half
  // a unit in the last place of float both as it came and as it leaves.
  double Error() const {
    const double reach =
        std::max(std::abs(min), std::abs(min + kLargest * step));
    return 0.5 * step + reach * std::ldexp(1.0, -23) * (1 + 1e-6);
  }
};

// The least and the greatest of every `dimension`-th number. False if one is
// not finite.
bool FindSide(std::span<const float> positions, int dimension, int d,
              Side& side) {
  float least = std::numeric_limits<float>::infinity();
  float greatest = -least;
  float zero = 0;  // NaN as soon as one number is not finite.
  for (size_t i = d; i < positions.size(); i += dimension) {
    least = std::min(least, positions[i]);
    greatest = std::max(greatest, positions[i]);
    zero += positions[i] * 0.0F;
  }
  side.min = least;
  side.step = (static_cast<double>(greatest) - least) / kLargest;
  return zero == 0;
}

template <int kDimension>
void Quantize(std::span<const float> positions, const Side (&sides)[3],
              uint8_t* out) {
  double per_step[kDimension];
  for (int d = 0; d < kDimension; ++d) {
    per_step[d] = sides[d].step > 0 ? 1 / sides[d].step : 0;
  }
  for (size_t i = 0; i < positions.size(); i += kDimension) {
    for (int d = 0; d < kDimension; ++d) {
      const double steps =
          (positions[i + d] - sides[d].min) * per_step[d] + 0.5;
      const auto u = static_cast<uint16_t>(std::min(steps, kLargest));
      std::memcpy(out + 2 * (i + d), &u, sizeof(u));
    }
  }
}

// Bytes of as many positions as there is room for.
template <int kDimension>
absl::Status DecodeBox(const uint8_t* bytes, std::span<float> positions) {
  Side sides[kDimension];
  for (Side& side : sides) {
    std::memcpy(&side.min, bytes, sizeof(double));
    std::memcpy(&side.step, bytes + sizeof(double), sizeof(double));
    bytes += kSideBytes;
    constexpr double kFloatMax = std::numeric_limits<float>::max();
    if (!(side.step >= 0 && std::abs(side.min) <= kFloatMax &&
          side.min + kLargest * side.step <= kFloatMax)) {
      return BadFrameData(absl::StrCat("the chunk's box, from ", side.min,
                                       " in steps of ", side.step,
                                       ", does not fit into floats"));
    }
  }
  for (size_t i = 0; i < positions.size(); i += kDimension) {
    for (int d = 0; d < kDimension; ++d) {
      uint16_t u;
      std::memcpy(&u, bytes + 2 * (i + d), sizeof(u));
      positions[i + d] = static_cast<float>(sides[d].min + u * sides[d].step);
    }
  }
  return absl::OkStatus();
}

absl::Status FindSides(const ChunkSource& source, Side (&sides)[3]) {
  double squares = 0;
  for (int d = 0; d < source.dimension; ++d) {
    if (!FindSide(source.positions, source.dimension, d, sides[d])) {
      return InvalidInput("NON_FINITE", "positions",
                          "a position is not finite");
    }
    squares += sides[d].Error() * sides[d].Error();
  }
  const double error = std::sqrt(squares);
  if (error <= source.tolerance) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kFailedPrecondition,
      absl::StrCat("16 bits are off by up to ", error,
                   " in the box of these vertices, not ", source.tolerance),
      {.reason = "TOLERANCE_NOT_MET", .field = "tolerance"});
}

class Quantized16 final : public FrameEncoding {
 public:
  absl::string_view id() const override { return "quantized16"; }
  double FinestTolerance(double reach) const override {
    const Side side{.min = -reach, .step = 2 * reach / kLargest};
    return std::sqrt(3.0) * side.Error();
  }

  int64_t PointsPerChunk(int dimension) const override {
    return (kMaxChunkBytes - dimension * kSideBytes) / (2 * dimension);
  }

  absl::StatusOr<int64_t> Encode(const ChunkSource& source,
                                 uint8_t* out) const override {
    Side sides[3];
    if (source.count > 0) DEFORM_RETURN_IF_ERROR(FindSides(source, sides));
    uint8_t* at = out;
    for (int d = 0; d < source.dimension; ++d) {
      std::memcpy(at, &sides[d].min, sizeof(double));
      std::memcpy(at + sizeof(double), &sides[d].step, sizeof(double));
      at += kSideBytes;
    }
    if (source.dimension == 2) {
      Quantize<2>(source.positions, sides, at);
    } else {
      Quantize<3>(source.positions, sides, at);
    }
    return at - out + static_cast<int64_t>(source.positions.size()) * 2;
  }

  absl::Status Decode(std::span<const uint8_t> bytes,
                      const ChunkTarget& target) const override {
    const int64_t header = target.dimension * kSideBytes;
    const int64_t needed =
        header + static_cast<int64_t>(target.positions.size()) * 2;
    if (static_cast<int64_t>(bytes.size()) != needed) {
      return BadFrameData(absl::StrCat("chunk has ", bytes.size(),
                                       " bytes, its vertices need ", needed));
    }
    return target.dimension == 2 ? DecodeBox<2>(bytes.data(), target.positions)
                                 : DecodeBox<3>(bytes.data(), target.positions);
  }
};

}  // namespace

const FrameEncoding& Quantized16Encoding() {
  static const Quantized16 encoding;
  return encoding;
}

}  // namespace deform
