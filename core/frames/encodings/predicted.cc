#include "core/frames/encodings/predicted.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/frames/grid_fit.h"
#include "core/kernels/grid_blocks.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "numbers are copied as they lie in memory");

constexpr int64_t kPlaneBytes = kGridGroup / 8;
constexpr int64_t kGroups = kGridBlock / kGridGroup;
constexpr int kOffsetBytes[4] = {0, 1, 2, 4};

// The most that a block takes.
constexpr int64_t MaxBlockBytes(int dimension) {
  const int64_t coordinate =
      2 + 4 + 2 * dimension + kGroups * (1 + 32 * kPlaneBytes);
  return 1 + dimension * coordinate;
}

// Bytes of outside, taken from the front.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  size_t left() const { return bytes_.size(); }
  // Null if there are not so many left.
  const uint8_t* Take(size_t count) {
    if (count > bytes_.size()) return nullptr;
    const uint8_t* const taken = bytes_.data();
    bytes_ = bytes_.subspan(count);
    return taken;
  }

 private:
  std::span<const uint8_t> bytes_;
};

// A number of `bytes` bytes, sign and all.
int32_t Number(const uint8_t* from, int bytes) {
  if (bytes == 0) return 0;
  uint32_t number = 0;
  std::memcpy(&number, from, bytes);
  const int unused = 32 - 8 * bytes;
  return static_cast<int32_t>(number << unused) >> unused;
}

void Put(int32_t number, int bytes, uint8_t*& out) {
  std::memcpy(out, &number, bytes);
  out += bytes;
}

// Which of kOffsetBytes holds it.
int OffsetSize(int32_t offset) {
  if (offset == 0) return 0;
  if (offset == static_cast<int8_t>(offset)) return 1;
  return offset == static_cast<int16_t>(offset) ? 2 : 3;
}

int64_t GroupsOf(int64_t points) {
  return (points + kGridGroup - 1) / kGridGroup;
}

// The block's points in a grid, or the places of a block without reference.
GridBlock BlockOf(const Grid* grid, int64_t first) {
  alignas(64) static constexpr int32_t kNowhere[kGridBlock] = {};
  if (grid == nullptr) return {{kNowhere, kNowhere, kNowhere}};
  return {{grid->coordinate(0) + first, grid->coordinate(1) + first,
           grid->coordinate(2) + first}};
}

void EncodeResiduals(const GridBlock& reference, int d, const int32_t* grid,
                     const GridPrediction& prediction, int64_t points,
                     uint8_t*& out) {
  alignas(64) uint32_t folded[kGridBlock];
  FoldResiduals(reference, d, grid, prediction, folded);
  const int64_t groups = GroupsOf(points);
  std::array<int, kGroups> bits;
  for (int64_t g = 0; g < groups; ++g) {
    uint32_t all = 0;
    for (int64_t i = 0; i < kGridGroup; ++i) all |= folded[g * kGridGroup + i];
    bits[g] = static_cast<int>(std::bit_width(all));
    *out++ = static_cast<uint8_t>(bits[g]);
  }
  for (int64_t g = 0; g < groups; ++g) {
    PackBits(folded + g * kGridGroup, bits[g], out);
    out += bits[g] * kPlaneBytes;
  }
}

void EncodeBlock(const GridBlock& reference, const GridBlock& grid,
                 int dimension, int64_t points, uint8_t*& out) {
  const BlockFit fit = FitBlock(reference, grid);
  *out++ = static_cast<uint8_t>(fit.of[0].shift);
  for (int d = 0; d < dimension; ++d) {
    const GridPrediction& prediction = fit.of[d];
    const int gradient_bytes = fit.gradient_bytes[d];
    const int offset_size = OffsetSize(prediction.offset);
    *out++ = static_cast<uint8_t>(gradient_bytes | offset_size << 2);
    if (gradient_bytes > 0) *out++ = static_cast<uint8_t>(prediction.fraction);
    Put(prediction.offset, kOffsetBytes[offset_size], out);
    for (int k = 0; k < dimension; ++k) {
      Put(prediction.gradient[k], gradient_bytes, out);
    }
    EncodeResiduals(reference, d, grid.of[d], prediction, points, out);
  }
}

absl::StatusOr<GridPrediction> DecodePrediction(Reader& in, int shift,
                                                int dimension) {
  const uint8_t* const sizes = in.Take(1);
  if (sizes == nullptr)
    return BadFrameData("a block ends before its prediction");
  const int gradient_bytes = *sizes & 3;
  const int offset_bytes = kOffsetBytes[*sizes >> 2 & 3];
  if (gradient_bytes == 3 || *sizes >> 4 != 0) {
    return BadFrameData(
        absl::StrCat("a prediction has the unknown sizes ", *sizes));
  }
  GridPrediction prediction{.shift = shift};
  if (gradient_bytes > 0) {
    const uint8_t* const fraction = in.Take(1);
    if (fraction == nullptr || *fraction > 31) {
      return BadFrameData("a prediction has no fraction from 0 to 31");
    }
    prediction.fraction = *fraction;
  }
  const uint8_t* numbers = in.Take(offset_bytes + dimension * gradient_bytes);
  if (numbers == nullptr) return BadFrameData("a block ends in its prediction");
  prediction.offset = Number(numbers, offset_bytes);
  numbers += offset_bytes;
  for (int k = 0; k < dimension; ++k) {
    prediction.gradient[k] = Number(numbers, gradient_bytes);
    numbers += gradient_bytes;
  }
  return prediction;
}

absl::Status DecodeResiduals(Reader& in, int64_t points, uint32_t* folded) {
  const int64_t groups = GroupsOf(points);
  const uint8_t* const bits = in.Take(groups);
  if (bits == nullptr) return BadFrameData("a block ends before its residuals");
  for (int64_t g = 0; g < groups; ++g) {
    if (bits[g] > 32) {
      return BadFrameData(
          absl::StrCat("a group has ", bits[g], " bits a residual, of 32"));
    }
    const uint8_t* const planes = in.Take(bits[g] * kPlaneBytes);
    if (planes == nullptr) return BadFrameData("a block ends in its residuals");
    UnpackBits(planes, bits[g], folded + g * kGridGroup);
  }
  return absl::OkStatus();
}

absl::Status DecodeBlock(Reader& in, const GridBlock& reference, int dimension,
                         int64_t points, int32_t* const (&grid)[3]) {
  const uint8_t* const shift = in.Take(1);
  if (shift == nullptr)
    return BadFrameData("the chunk ends before its last block");
  if (*shift > 31) {
    return BadFrameData(absl::StrCat("a block has shift ", *shift, ", of 31"));
  }
  for (int d = 0; d < dimension; ++d) {
    DEFORM_ASSIGN_OR_RETURN(const GridPrediction prediction,
                            DecodePrediction(in, *shift, dimension));
    alignas(64) uint32_t folded[kGridBlock] = {};
    DEFORM_RETURN_IF_ERROR(DecodeResiduals(in, points, folded));
    AddResiduals(reference, d, folded, prediction, grid[d]);
  }
  return absl::OkStatus();
}

class Predicted final : public FrameEncoding {
 public:
  absl::string_view id() const override { return "predicted"; }
  bool uses_grid() const override { return true; }
  double FinestTolerance(double reach) const override {
    return reach / kGridLimit;
  }

  int64_t PointsPerChunk(int dimension) const override {
    return kMaxChunkBytes / MaxBlockBytes(dimension) * kGridBlock;
  }

  absl::StatusOr<int64_t> Encode(const ChunkSource& source,
                                 uint8_t* out) const override {
    assert(source.first % kGridBlock == 0);
    uint8_t* const begin = out;
    const int64_t end = source.first + source.count;
    for (int64_t i = source.first; i < end; i += kGridBlock) {
      EncodeBlock(BlockOf(source.reference, i), BlockOf(source.grid, i),
                  source.dimension, std::min(kGridBlock, end - i), out);
    }
    return out - begin;
  }

  absl::Status Decode(std::span<const uint8_t> bytes,
                      const ChunkTarget& target) const override {
    const int64_t end = target.first + target.count;
    if (target.first % kGridBlock != 0 ||
        (target.count % kGridBlock != 0 && end != target.grid->size())) {
      return BadFrameData(absl::StrCat("a chunk holds points from ",
                                       target.first, " on, ", target.count,
                                       " of them: no whole blocks"));
    }
    Reader in(bytes);
    for (int64_t i = target.first; i < end; i += kGridBlock) {
      DEFORM_RETURN_IF_ERROR(DecodeBlock(
          in, BlockOf(target.reference, i), target.dimension,
          std::min(kGridBlock, end - i),
          {target.grid->coordinate(0) + i, target.grid->coordinate(1) + i,
           target.grid->coordinate(2) + i}));
    }
    if (in.left() > 0) {
      return BadFrameData(
          absl::StrCat("a chunk has ", in.left(), " bytes behind its blocks"));
    }
    if (end == target.grid->size()) target.grid->Pad();
    return absl::OkStatus();
  }
};

}  // namespace

const FrameEncoding& PredictedEncoding() {
  static const Predicted encoding;
  return encoding;
}

}  // namespace deform
