#include "core/weights/schemes/lane_evaluator.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/aligned_array.h"
#include "core/kernels/weight_tiles.h"

namespace deform {
namespace {

bool IsSolved(const LanePoints& points, int64_t lane) {
  return points.solved >> lane & 1;
}

std::span<double> SpanOf(RowMatrix& matrix, int64_t row) {
  return {matrix.data() + row * matrix.cols(),
          static_cast<size_t>(matrix.cols())};
}

// One lane of each column.
void CopyLane(const double* tile, int64_t lane, std::span<double> row) {
  for (size_t c = 0; c < row.size(); ++c) {
    row[c] = tile[static_cast<int64_t>(c) * kTilePoints + lane];
  }
}

void RoundIntoLane(std::span<const double> row, int64_t lane, float* tile) {
  for (size_t c = 0; c < row.size(); ++c) {
    tile[static_cast<int64_t>(c) * kTilePoints + lane] = RoundedWeight(row[c]);
  }
}

}  // namespace

double LaneScale(double size) { return std::exp2(-std::ilogb(size)); }

LanePoints LaneEvaluator::PointsAt(const PositionsRef& points,
                                   int64_t first) const {
  LanePoints lanes;
  lanes.count = std::min(kTilePoints, points.rows() - first);
  for (int64_t lane = 0; lane < kTilePoints; ++lane) {
    const int64_t i = first + std::min(lane, lanes.count - 1);
    for (int d = 0; d < 3; ++d) lanes.at[d][lane] = points(i, d) * lane_scale_;
  }
  return lanes;
}

PointState LaneEvaluator::StateOf(const LanePoints& points,
                                  int64_t lane) const {
  return points.inside >> lane & 1 ? PointState::kInside : outside_state_;
}

void LaneEvaluator::EvaluatePlain(const PositionsRef& points,
                                  WeightBlock& block) const {
  for (int64_t i = 0; i < points.rows(); ++i) {
    block.states[i] = EvaluatePoint(points.row(i), SpanOf(block.vertex, i),
                                    SpanOf(block.normal, i));
  }
}

void LaneEvaluator::Evaluate(const PositionsRef& points,
                             WeightBlock& block) const {
  const int64_t n = points.rows();
  block.vertex.resize(n, vertices_);
  block.normal.resize(n, normals_);
  block.states.resize(n);
  block.iterations.clear();
  block.residuals.clear();
  if (way_ == Way::kPlain) return EvaluatePlain(points, block);
  const AlignedArray<char> scratch(ScratchBytes());
  const AlignedArray<double> tile(columns() * kTilePoints);
  for (int64_t first = 0; first < n; first += kTilePoints) {
    LanePoints lanes = PointsAt(points, first);
    EvaluateLanes(lanes, scratch.get(), tile.get());
    for (int64_t lane = 0; lane < lanes.count; ++lane) {
      const int64_t i = first + lane;
      const std::span<double> vertex = SpanOf(block.vertex, i);
      const std::span<double> normal = SpanOf(block.normal, i);
      if (!IsSolved(lanes, lane)) {
        block.states[i] = EvaluatePoint(points.row(i), vertex, normal);
        continue;
      }
      CopyLane(tile.get(), lane, vertex);
      CopyLane(tile.get() + vertices_ * kTilePoints, lane, normal);
      block.states[i] = StateOf(lanes, lane);
    }
  }
}

void LaneEvaluator::EvaluateTiles(const PositionsRef& points,
                                  TileBlock& block) const {
  if (way_ == Way::kPlain) return WeightEvaluator::EvaluateTiles(points, block);
  const int64_t n = points.rows();
  block.states.resize(n);
  block.iterations.clear();
  block.residuals.clear();
  const AlignedArray<char> scratch(ScratchBytes());
  std::vector<double> row(columns());
  const std::span<double> vertex = std::span(row).first(vertices_);
  const std::span<double> normal = std::span(row).subspan(vertices_);
  for (int64_t first = 0; first < n; first += kTilePoints) {
    float* tile = block.tiles + first * columns();
    LanePoints lanes = PointsAt(points, first);
    EvaluateLanes(lanes, scratch.get(), tile);
    for (int64_t lane = 0; lane < lanes.count; ++lane) {
      PointState& state = block.states[first + lane];
      state = StateOf(lanes, lane);
      if (IsSolved(lanes, lane)) continue;
      state = EvaluatePoint(points.row(first + lane), vertex, normal);
      RoundIntoLane(row, lane, tile);
    }
    for (int64_t c = 0; c < columns(); ++c) {
      float* column = tile + c * kTilePoints;
      std::fill(column + lanes.count, column + kTilePoints, 0.0f);
    }
  }
}

}  // namespace deform
