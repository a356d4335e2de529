#include <Eigen/Core>

#include "tests/bench/baselines/baselines.h"

namespace deform::bench {
namespace {

template <typename Number>
void Product(const Number* weights, int64_t points, int64_t columns,
             const Number* column, Number* out) {
  using Rows =
      Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using Columns = Eigen::Matrix<Number, Eigen::Dynamic, 3, Eigen::RowMajor>;
  Eigen::Map<Columns>(out, points, 3).noalias() =
      Eigen::Map<const Rows>(weights, points, columns) *
      Eigen::Map<const Columns>(column, columns, 3);
}

}  // namespace

void PlainProduct(const float* weights, int64_t points, int64_t columns,
                  const float* column, float* out) {
  for (int64_t i = 0; i < points; ++i) {
    float x = 0, y = 0, z = 0;
    for (int64_t c = 0; c < columns; ++c) {
      const float w = weights[i * columns + c];
      x += w * column[c * 3];
      y += w * column[c * 3 + 1];
      z += w * column[c * 3 + 2];
    }
    out[i * 3] = x;
    out[i * 3 + 1] = y;
    out[i * 3 + 2] = z;
  }
}

void EigenProduct(const float* weights, int64_t points, int64_t columns,
                  const float* column, float* out) {
  Product(weights, points, columns, column, out);
}

void EigenProduct(const double* weights, int64_t points, int64_t columns,
                  const double* column, double* out) {
  Product(weights, points, columns, column, out);
}

float ReadAll(const float* data, int64_t count, int streams) {
  typedef float Lanes __attribute__((vector_size(64), aligned(64)));
  constexpr int64_t kLanes = 16;
  constexpr int64_t kAhead = 256;  // Floats: 1 KiB.
  Lanes sums[8] = {};
  const int64_t part = count / streams / kLanes * kLanes;
  for (int64_t i = 0; i < part; i += kLanes) {
    for (int s = 0; s < streams; ++s) {
      const float* at = data + s * part + i;
      __builtin_prefetch(at + kAhead);
      sums[s] += *reinterpret_cast<const Lanes*>(at);
    }
  }
  float total = 0;
  for (const Lanes& sum : sums) {
    for (int64_t l = 0; l < kLanes; ++l) total += sum[l];
  }
  return total;
}

}  // namespace deform::bench
