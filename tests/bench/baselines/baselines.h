// What others do, to compare with. Compiled for this very machine, in a library
// of its own whose templates nobody else's get mixed with.
#pragma once

#include <cstdint>

#define DEFORM_BASELINE __attribute__((visibility("default")))

namespace deform::bench {

// out (points x 3) = weights (points x columns, row by row) x column (columns x
// 3), as one would write it down.
DEFORM_BASELINE void PlainProduct(const float* weights, int64_t points,
                                  int64_t columns, const float* column,
                                  float* out);
// The same by Eigen.
DEFORM_BASELINE void EigenProduct(const float* weights, int64_t points,
                                  int64_t columns, const float* column,
                                  float* out);
DEFORM_BASELINE void EigenProduct(const double* weights, int64_t points,
                                  int64_t columns, const double* column,
                                  double* out);

// Sums of `count` floats: with `streams` walks at once over equal parts.
DEFORM_BASELINE float ReadAll(const float* data, int64_t count, int streams);

}  // namespace deform::bench
