// Free control points: a rig without connectivity.
#pragma once

#include "absl/status/statusor.h"
#include "core/mesh/types.h"

namespace deform {

// n control points that span their space. Immutable and right.
class Handles {
 public:
  // `positions` is n x 3 (third column 0 in 2D). Refuses with InvalidArgument
  // BAD_DIMENSION, NON_FINITE, COORDINATE_TOO_LARGE, NOT_PLANAR and
  // DEGENERATE_HANDLES (fewer than dimension + 1, or all in one plane or line).
  static absl::StatusOr<Handles> Create(int dimension, Positions positions);

  int dimension() const { return dimension_; }
  int64_t size() const { return positions_.rows(); }
  const Positions& positions() const { return positions_; }
  // Diagonal of the bounding box, D.
  double diagonal() const { return diagonal_; }

 private:
  Handles(int dimension, Positions positions, double diagonal);

  int dimension_;
  Positions positions_;
  double diagonal_;
};

}  // namespace deform
