// The last level of compressed weights: few columns of small integers for the
// rows of a leaf, proved.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/kernels/apply_mixed.h"
#include "core/kernels/weight_tiles.h"
#include "core/weights/scheme.h"

namespace deform {

// A leaf about to be compressed. All weights are in units of the pose bounds
// R_c: weight x R_c.
struct LeafRows {
  Tiles<double> weights;       // n x C, what is to be reproduced.
  Tiles<double> coefficients;  // n x r, of the branch's basis.
  RowMatrix branch_basis;      // r x C, as stored.
  double tolerance = 0;        // Of a row: sum over c of |error| R_c.
  double first_budget = 0;     // Where to begin: 2-norm of a row's error.
  bool exact = false;          // Give up nothing but the digits of float.
};

// weights = (1 rows[0] + numbers rows[1 ..]) branch_basis, to the bound.
struct LeafFit {
  RowMatrix rows;  // (1 + columns) x r, float numbers.
  MixedColumns columns;
  double step = 0;
  std::vector<std::byte> numbers;  // Blocks of 64 points.
  // Largest error of a row over what it may be; at most 1 if it is good.
  double excess = 0;
  // Proved: largest sum over c of |error| R_c, and what rounding may add.
  double bound = 0;
};

// The smallest fit it finds within the tolerance, or one with excess > 1.
LeafFit FitLeaf(const LeafRows& leaf);

}  // namespace deform
