// How coarsely the coefficients of a leaf may be told.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "core/frames/leaf_basis.h"

namespace deform {

// Coefficients of a leaf as whole numbers of steps.
struct RoundedLeaf {
  int scale = 0;                 // 0 to kMaxScale.
  std::vector<int32_t> numbers;  // rows() x dimension.
};

inline constexpr int kMaxScale = 127;

// What 1 of a coefficient stands for, with the e_k of its column (0 for c_0).
// Four scales make a factor of 2.
inline double CoefficientStep(double unit, int scale, int exponent) {
  return std::ldexp(unit * (4 + scale % 4), scale / 4 - exponent);
}

// Of what scales count for a tolerance: scale 0 is far finer than it needs, and
// the last far too coarse.
inline double UnitFor(double tolerance) { return std::ldexp(tolerance, -16); }

// The largest scale, or nearly, with which no sum of the leaf's slots is
// farther than `tolerance` from that of `coefficients` (rows() x 3, finite).
// Tried on the slots: a bound that does not look at them has to be 8 times as
// fine. False if there is none: then they are to be told as they are.
bool RoundLeaf(const LeafBasis::Leaf& leaf, int dimension,
               const float* coefficients, double tolerance,
               RoundedLeaf& rounded);

}  // namespace deform
