// Free control points: a rig without connectivity.
#pragma once

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"
#include "core/mesh/types.h"

namespace deform {

// n control points that span their space. The last of them may be fixed: no
// pose moves them. Immutable and right.
class Handles {
 public:
  // `free` and `fixed` have a row for each handle (third column 0 in 2D).
  // Refuses with InvalidArgument BAD_DIMENSION, NON_FINITE,
  // COORDINATE_TOO_LARGE, NOT_PLANAR and DEGENERATE_HANDLES (none that is free,
  // fewer than dimension + 1, or all in one plane or line).
  static absl::StatusOr<Handles> Create(int dimension, Positions free,
                                        const Positions& fixed = {});

  int dimension() const { return dimension_; }
  int64_t size() const { return positions_.rows(); }
  int64_t free_count() const { return free_count_; }
  int64_t fixed_count() const { return size() - free_count_; }
  // n x 3: the free ones, then the fixed.
  const Positions& positions() const { return positions_; }
  // Diagonal of the bounding box, D.
  double diagonal() const { return diagonal_; }

 private:
  Handles(int dimension, Positions positions, int64_t free_count,
          double diagonal);

  int dimension_;
  Positions positions_;
  int64_t free_count_;
  double diagonal_;
};

// The corners of the model's bounding box, 1.6 times as large about its middle
// ([C16] section 6), 8 in 3D and 4 in 2D: as fixed handles they put the model
// strictly inside the hull. Of the model alone, so that they stay where they
// are when handles are edited. A side of a flat model's box counts as at least
// 1 % of its diagonal.
Positions BoxHandles(const Mesh& model);

}  // namespace deform
