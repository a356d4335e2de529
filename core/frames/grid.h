// Positions on an integer grid: what encodings that predict send losslessly.
//
// The step of the grid IS the tolerance of a session, in model units, fixed for
// as long as it lasts. A coordinate x, relative to the frame's origin, becomes
//
//   q = the integer nearest to x / step        |q| <= 2^20
//
// and comes back as float(q * step), the product in double. Coordinates up to
// 2^20 steps are off by half a step, and, as floats, by 1/32 of a step on each
// side: in space by at most sqrt(3) (1/2 + 1/32 + 1/32) = 0.975 steps. Beyond,
// floats themselves are too coarse for the tolerance (OUT_OF_GRID): such a
// frame is sent as float32, and is no reference for others.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/aligned_array.h"
#include "core/frames/point_order.h"
#include "core/kernels/grid_blocks.h"

namespace deform {

class ThreadPool;

// Integers made here are not larger than this.
inline constexpr int32_t kGridLimit = int32_t{1} << 20;

// The integers of one revision, in the order of a PointOrder. Filled in once,
// then shared and never changed.
class Grid {
 public:
  // All 0. Takes 12 bytes a point.
  explicit Grid(int64_t points);
  Grid(Grid&&) = default;
  Grid& operator=(Grid&&) = default;

  int64_t size() const { return points_; }
  // size() rounded up to whole blocks: the numbers that a coordinate has room
  // for.
  int64_t padded_size() const { return padded_; }

  // Coordinates d = 0, 1, 2, each size() numbers behind each other; in 2D the
  // last are 0.
  const int32_t* coordinate(int d) const {
    return numbers_.get() + d * padded_;
  }
  int32_t* coordinate(int d) { return numbers_.get() + d * padded_; }

  // Fills what is behind the last point with copies of it.
  void Pad();

 private:
  int64_t points_;
  int64_t padded_;
  AlignedArray<int32_t> numbers_;
};

// Puts `positions` (N x dimension, relative to the origin, in the order of the
// model) on the grid. FailedPrecondition OUT_OF_GRID, InvalidArgument
// NON_FINITE; both name the point. `pool` may be null.
absl::StatusOr<Grid> PutOnGrid(std::span<const float> positions, int dimension,
                               double step, const PointOrder& order,
                               ThreadPool* pool = nullptr);

// The reverse, for grids of any content.
void TakeOffGrid(const Grid& grid, double step, const PointOrder& order,
                 int dimension, std::span<float> positions);

// InvalidArgument TOLERANCE_OUT_OF_RANGE unless tolerance is a number above 0
// whose grid lies in the range of normal floats: 1e-30 to 1e28.
absl::Status CheckTolerance(double tolerance);

}  // namespace deform
