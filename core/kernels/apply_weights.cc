#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

constexpr int kLanes = kTilePoints;

// Three accumulators of one tile; fixed lengths let the compiler keep them in
// registers.
template <typename Real>
struct Sums {
  Real x[kLanes] = {};
  Real y[kLanes] = {};
  Real z[kLanes] = {};

  void Add(const float* weights, const Real* column) {
    for (int i = 0; i < kLanes; ++i) x[i] += weights[i] * column[0];
    for (int i = 0; i < kLanes; ++i) y[i] += weights[i] * column[1];
    for (int i = 0; i < kLanes; ++i) z[i] += weights[i] * column[2];
  }
};

}  // namespace

void ApplyTile(const float* tile, int64_t columns, const float* column,
               float* out) {
  Sums<float> sums;
  for (int64_t c = 0; c < columns; ++c) {
    sums.Add(tile + c * kLanes, column + c * 3);
  }
  for (int i = 0; i < kLanes; ++i) {
    out[i] = sums.x[i];
    out[kLanes + i] = sums.y[i];
    out[2 * kLanes + i] = sums.z[i];
  }
}

void AddTileColumns(const float* tile, const int32_t* index, int64_t count,
                    const double* delta, double* out) {
  Sums<double> sums;
  for (int64_t k = 0; k < count; ++k) {
    sums.Add(tile + int64_t{index[k]} * kLanes, delta + k * 3);
  }
  for (int i = 0; i < kLanes; ++i) {
    out[i] += sums.x[i];
    out[kLanes + i] += sums.y[i];
    out[2 * kLanes + i] += sums.z[i];
  }
}

void ApplyTilePlain(const float* tile, int64_t columns, const double* column,
                    double* out) {
  for (int i = 0; i < kLanes; ++i) {
    for (int d = 0; d < 3; ++d) {
      double sum = 0;
      for (int64_t c = 0; c < columns; ++c) {
        sum += double{tile[c * kLanes + i]} * column[c * 3 + d];
      }
      out[d * kLanes + i] = sum;
    }
  }
}

}  // namespace deform
