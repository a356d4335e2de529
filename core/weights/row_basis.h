// Few directions that many rows lie near to.
#pragma once

#include <cstdint>

#include "core/kernels/weight_tiles.h"
#include "core/weights/scheme.h"

namespace deform {

// Adds to `basis`, whose rows are orthonormal, the directions of the candidates
// (rows) that lie farthest from its span, one by one, until none is farther
// than `threshold`, or than 3e-7 of what it was at first: then another call
// goes on. Pivoted Gram-Schmidt, each direction orthogonalised twice.
void ExtendBasis(const RowMatrix& candidates, double threshold,
                 RowMatrix& basis);

// The rows of a matrix in the coordinates of their own principal axes.
struct PrincipalRows {
  RowMatrix axes;      // k x columns, orthonormal, largest first.
  Tiles<double> rows;  // points x k
};

// All axes but those with which no row loses more than `negligible` of its
// length.
PrincipalRows InPrincipalAxes(const Tiles<double>& rows, double negligible);

// The fewest leading columns without which no row is longer than `threshold`.
int64_t RankWithin(const Tiles<double>& rows, double threshold);

}  // namespace deform
