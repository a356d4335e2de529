#include "core/frames/grid.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/thread_pool.h"

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

// Points that a thread puts on the grid in a row.
constexpr int64_t kPart = 32 * kGridBlock;

// Those from `first` on, a block. False if one may not be on the grid.
bool PutBlock(const float* positions, int dimension, double per_step,
              const PointOrder& order, int64_t first, Grid& grid) {
  alignas(64) float block[3][kGridBlock];
  const int64_t count = std::min(kGridBlock, order.size() - first);
  for (int64_t i = 0; i < kGridBlock; ++i) {
    const int64_t point = order.points()[first + std::min(i, count - 1)];
    const float* const x = positions + point * dimension;
    block[0][i] = x[0];
    block[1][i] = x[1];
    if (dimension == 3) block[2][i] = x[2];
  }
  bool within = true;
  for (int d = 0; d < dimension; ++d) {
    within &=
        RoundToGrid(block[d], per_step, kGridLimit, grid.coordinate(d) + first);
  }
  return within;
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
                               double step, const PointOrder& order,
                               ThreadPool* pool) {
  const int64_t points = order.size();
  assert(static_cast<int64_t>(positions.size()) == points * dimension);
  Grid grid(points);
  std::atomic<bool> within = true;
  const int64_t parts = (points + kPart - 1) / kPart;
  ParallelFor(pool, parts, nullptr, [&](int64_t part) {
    const int64_t end = std::min((part + 1) * kPart, points);
    for (int64_t first = part * kPart; first < end; first += kGridBlock) {
      if (!PutBlock(positions.data(), dimension, 1 / step, order, first,
                    grid)) {
        within = false;
      }
    }
  });
  if (within) return grid;
  for (const int32_t point : order.points()) {
    const absl::Status status = CheckOnGrid(
        positions.data() + int64_t{point} * dimension, dimension, step, point);
    if (!status.ok()) return status;
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
