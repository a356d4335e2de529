#include "core/frames/grid.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {
namespace {

// Why point `i` of the model is not on the grid; Ok if it is.
absl::Status CheckOnGrid(const float* x, int dimension, double step,
                         int64_t i) {
  for (int d = 0; d < dimension; ++d) {
    if (!std::isfinite(x[d])) {
      return InvalidInput(
          "NON_FINITE", "positions",
          absl::StrCat("point ", i, " has a coordinate that is not finite"));
    }
    if (!(std::abs(x[d] * (1 / step)) <= kGridLimit)) {
      return MakeError(absl::StatusCode::kFailedPrecondition,
                       absl::StrCat("point ", i, " is ", std::abs(x[d]),
                                    " from the origin; a grid of step ", step,
                                    " reaches to ", kGridLimit * step),
                       {.reason = "OUT_OF_GRID", .field = "tolerance"});
    }
  }
  return absl::OkStatus();
}

}  // namespace

Grid::Grid(int64_t points)
    : points_(points),
      padded_((points + kGridBlock - 1) / kGridBlock * kGridBlock),
      numbers_(3 * padded_) {
  std::fill_n(numbers_.get(), 3 * padded_, 0);
}

void Grid::Pad() {
  if (points_ == 0) return;
  for (int d = 0; d < 3; ++d) {
    int32_t* const numbers = coordinate(d);
    std::fill(numbers + points_, numbers + padded_, numbers[points_ - 1]);
  }
}

absl::StatusOr<Grid> PutOnGrid(std::span<const float> positions, int dimension,
                               double step, const PointOrder& order) {
  const int64_t points = order.size();
  assert(static_cast<int64_t>(positions.size()) == points * dimension);
  const double per_step = 1 / step;
  Grid grid(points);
  alignas(64) float block[3][kGridBlock] = {};
  for (int64_t first = 0; first < points; first += kGridBlock) {
    const int64_t count = std::min(kGridBlock, points - first);
    for (int64_t i = 0; i < kGridBlock; ++i) {
      const int64_t point = order.points()[first + std::min(i, count - 1)];
      const float* const x = positions.data() + point * dimension;
      block[0][i] = x[0];
      block[1][i] = x[1];
      if (dimension == 3) block[2][i] = x[2];
    }
    bool within = true;
    for (int d = 0; d < dimension; ++d) {
      within &= RoundToGrid(block[d], per_step, kGridLimit,
                            grid.coordinate(d) + first);
    }
    if (within) continue;
    for (int64_t i = first; i < first + count; ++i) {
      const int64_t point = order.points()[i];
      if (absl::Status status = CheckOnGrid(
              positions.data() + point * dimension, dimension, step, point);
          !status.ok()) {
        return status;
      }
    }
  }
  return grid;
}

void TakeOffGrid(const Grid& grid, double step, const PointOrder& order,
                 int dimension, std::span<float> positions) {
  assert(grid.size() == order.size() &&
         static_cast<int64_t>(positions.size()) == grid.size() * dimension);
  alignas(64) float block[3][kGridBlock];
  for (int64_t first = 0; first < grid.size(); first += kGridBlock) {
    for (int d = 0; d < dimension; ++d) {
      LeaveGrid(grid.coordinate(d) + first, step, block[d]);
    }
    const int64_t count = std::min(kGridBlock, grid.size() - first);
    for (int64_t i = 0; i < count; ++i) {
      const int64_t point = order.points()[first + i];
      float* const x = positions.data() + point * dimension;
      x[0] = block[0][i];
      x[1] = block[1][i];
      if (dimension == 3) x[2] = block[2][i];
    }
  }
}

absl::Status CheckTolerance(double tolerance) {
  if (tolerance >= 1e-30 && tolerance <= 1e28) return absl::OkStatus();
  return InvalidInput(
      "TOLERANCE_OUT_OF_RANGE", "tolerance",
      absl::StrCat("tolerance is ", tolerance, ", not within 1e-30 and 1e28"));
}

}  // namespace deform
