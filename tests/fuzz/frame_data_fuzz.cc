// Chunks of every encoding that needs nothing, as they come from outside:
// positions that are finite, or a grid, or BAD_FRAME.
//
// Input: five bytes, which encoding, dimension, points (two) and whether there
// is a reference; then the chunk.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "core/base/error.h"
#include "core/frames/encoding.h"
#include "tests/fuzz/expect.h"

namespace deform {
namespace {

constexpr double kStep = 1e-4;

bool IsWithinLimits(const Grid& grid) {
  for (int d = 0; d < 3; ++d) {
    const int32_t* const numbers = grid.coordinate(d);
    if (!std::all_of(numbers, numbers + grid.size(), [](int32_t q) {
          return q >= -kGridLimit && q <= kGridLimit;
        })) {
      return false;
    }
  }
  return true;
}

// What was decoded can be sent on.
void ExpectComesBack(const FrameEncoding& encoding, const Grid& grid,
                     const Grid* reference, int dimension) {
  std::vector<uint8_t> bytes(kMaxChunkBytes);
  const absl::StatusOr<int64_t> size = encoding.Encode({.dimension = dimension,
                                                        .count = grid.size(),
                                                        .grid = &grid,
                                                        .reference = reference},
                                                       bytes.data());
  FUZZ_EXPECT(size.ok());
  Grid again(grid.size());
  FUZZ_EXPECT(encoding
                  .Decode({bytes.data(), static_cast<size_t>(*size)},
                          {.dimension = dimension,
                           .count = grid.size(),
                           .grid = &again,
                           .reference = reference})
                  .ok());
  for (int d = 0; d < 3; ++d) {
    FUZZ_EXPECT(std::equal(grid.coordinate(d),
                           grid.coordinate(d) + grid.padded_size(),
                           again.coordinate(d)));
  }
}

void Decode(const FrameEncoding& encoding, int dimension, int64_t points,
            const Grid* reference, std::span<const uint8_t> bytes) {
  std::vector<float> positions(points * dimension);
  Grid grid(points);
  const absl::Status status = encoding.Decode(bytes, {.dimension = dimension,
                                                      .count = points,
                                                      .positions = positions,
                                                      .grid = &grid,
                                                      .reference = reference});
  if (!status.ok()) {
    FUZZ_EXPECT(DetailOf(status).reason == "BAD_FRAME");
    return;
  }
  if (encoding.is_exact()) return;  // Its floats are what they are.
  if (encoding.uses_grid()) {
    const PointOrder order(Positions::Zero(points, 3));
    TakeOffGrid(grid, kStep, order, dimension, positions);
    if (IsWithinLimits(grid)) {
      ExpectComesBack(encoding, grid, reference, dimension);
    }
  }
  for (const float x : positions) FUZZ_EXPECT(std::isfinite(x));
}

}  // namespace
}  // namespace deform

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 5) return 0;
  std::vector<const deform::FrameEncoding*> encodings;
  for (const deform::FrameEncoding* encoding : deform::AllEncodings()) {
    if (encoding->needs() == deform::Needs::kNothing) {
      encodings.push_back(encoding);
    }
  }
  const deform::FrameEncoding& encoding =
      *encodings[data[0] % encodings.size()];
  const int dimension = data[1] % 2 == 0 ? 2 : 3;
  const int64_t points = (data[2] + 256 * data[3]) % 1000;
  deform::Grid reference(points);
  for (int d = 0; d < dimension; ++d) {
    for (int64_t i = 0; i < points; ++i) {
      reference.coordinate(d)[i] = static_cast<int32_t>(i * (37 - 50 * d));
    }
  }
  reference.Pad();
  deform::Decode(encoding, dimension, points,
                 data[4] % 2 == 0 ? nullptr : &reference, {data + 5, size - 5});
  return 0;
}
