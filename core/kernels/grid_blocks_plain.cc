// Number by number, as the header says it.
#include <cmath>
#include <cstring>

#include "core/kernels/grid_blocks.h"

namespace deform {
namespace {

// Differences and sums modulo 2^32.
int32_t Minus(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) -
                              static_cast<uint32_t>(b));
}
uint32_t Product(int32_t a, int32_t b) {
  return static_cast<uint32_t>(a) * static_cast<uint32_t>(b);
}

uint32_t Magnitude(int32_t x) { return static_cast<uint32_t>(x ^ (x >> 31)); }

int32_t Predicted(const GridBlock& reference, int d, int64_t i,
                  const GridPrediction& prediction) {
  uint32_t sum = (uint32_t{1} << prediction.fraction) >> 1;
  for (int k = 0; k < 3; ++k) {
    const int32_t place = Minus(reference.of[k][i], reference.of[k][0]);
    sum += Product(prediction.gradient[k], place >> prediction.shift);
  }
  const int32_t linear = static_cast<int32_t>(sum) >> prediction.fraction;
  return static_cast<int32_t>(static_cast<uint32_t>(reference.of[d][i]) +
                              static_cast<uint32_t>(prediction.offset) +
                              static_cast<uint32_t>(linear));
}

}  // namespace

bool RoundToGridPlain(const float* x, double per_step, double limit,
                      int32_t* grid) {
  bool within = true;
  for (int64_t i = 0; i < kGridBlock; ++i) {
    const double steps = x[i] * per_step;
    if (std::abs(steps) <= limit) {
      grid[i] = static_cast<int32_t>(std::nearbyint(steps));
    } else {
      grid[i] = 0;
      within = false;
    }
  }
  return within;
}

void LeaveGridPlain(const int32_t* grid, double step, float* x) {
  for (int64_t i = 0; i < kGridBlock; ++i) {
    x[i] = static_cast<float>(grid[i] * step);
  }
}

GridExtent MeasureExtentPlain(const GridBlock& reference,
                              const GridBlock& grid) {
  GridExtent extent = {};
  for (int d = 0; d < 3; ++d) {
    const int32_t* const a = reference.of[d];
    const int32_t* const q = grid.of[d];
    for (int64_t i = 0; i < kGridBlock; ++i) {
      extent.place[d] |= Magnitude(Minus(a[i], a[0]));
      extent.motion[d] |=
          Magnitude(Minus(Minus(q[i], a[i]), Minus(q[0], a[0])));
    }
  }
  return extent;
}

GridMoments SumMomentsPlain(const GridBlock& reference, const GridBlock& grid,
                            int place_shift, const int (&motion_shift)[3]) {
  GridMoments sums = {};
  for (int64_t i = 0; i < kGridBlock; ++i) {
    int32_t place[3], motion[3];
    for (int d = 0; d < 3; ++d) {
      const int32_t* const a = reference.of[d];
      const int32_t* const q = grid.of[d];
      place[d] = Minus(a[i], a[0]) >> place_shift;
      motion[d] =
          Minus(Minus(q[i], a[i]), Minus(q[0], a[0])) >> motion_shift[d];
    }
    for (int d = 0; d < 3; ++d) {
      sums.places[d] += place[d];
      sums.motions[d] += motion[d];
      for (int k = d; k < 3; ++k) {
        sums.place_products[d][k] += place[d] * place[k];
      }
      for (int k = 0; k < 3; ++k) {
        sums.motion_products[d][k] += motion[d] * place[k];
      }
    }
  }
  return sums;
}

void FoldResidualsPlain(const GridBlock& reference, int d, const int32_t* grid,
                        const GridPrediction& prediction, uint32_t* folded) {
  for (int64_t i = 0; i < kGridBlock; ++i) {
    const int32_t left = Minus(grid[i], Predicted(reference, d, i, prediction));
    folded[i] =
        (static_cast<uint32_t>(left) << 1) ^ static_cast<uint32_t>(left >> 31);
  }
}

void AddResidualsPlain(const GridBlock& reference, int d,
                       const uint32_t* folded, const GridPrediction& prediction,
                       int32_t* grid) {
  for (int64_t i = 0; i < kGridBlock; ++i) {
    const uint32_t left = (folded[i] >> 1) ^ (0 - (folded[i] & 1));
    grid[i] = static_cast<int32_t>(
        static_cast<uint32_t>(Predicted(reference, d, i, prediction)) + left);
  }
}

void PackBitsPlain(const uint32_t* values, int bits, uint8_t* out) {
  std::memset(out, 0, bits * (kGridGroup / 8));
  for (int k = 0; k < bits; ++k) {
    for (int64_t i = 0; i < kGridGroup; ++i) {
      out[k * (kGridGroup / 8) + i / 8] |= (values[i] >> k & 1) << (i % 8);
    }
  }
}

void UnpackBitsPlain(const uint8_t* planes, int bits, uint32_t* values) {
  for (int64_t i = 0; i < kGridGroup; ++i) {
    values[i] = 0;
    for (int k = 0; k < bits; ++k) {
      const uint32_t bit = planes[k * (kGridGroup / 8) + i / 8] >> (i % 8) & 1;
      values[i] |= bit << k;
    }
  }
}

}  // namespace deform
