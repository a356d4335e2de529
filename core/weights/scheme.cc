#include "core/weights/scheme.h"

#include <algorithm>
#include <utility>

#include "core/kernels/weight_tiles.h"

namespace deform {
namespace {

// Rounds up to 16 rows into one tile, from column `first` on.
void RoundRows(const RowMatrix& rows, int64_t at, int64_t first, float* tile) {
  const int64_t count = std::min(kTilePoints, rows.rows() - at);
  for (int64_t c = 0; c < rows.cols(); ++c) {
    float* column = tile + (first + c) * kTilePoints;
    for (int64_t i = 0; i < count; ++i) {
      column[i] = RoundedWeight(rows(at + i, c));
    }
    std::fill(column + count, column + kTilePoints, 0.0f);
  }
}

}  // namespace

void WeightEvaluator::EvaluateTiles(const PositionsRef& points,
                                    TileBlock& block) const {
  WeightBlock doubles{.known = std::move(block.known)};
  Evaluate(points, doubles);
  const int64_t columns = doubles.vertex.cols() + doubles.normal.cols();
  for (int64_t at = 0; at < points.rows(); at += kTilePoints) {
    float* tile = block.tiles + at * columns;
    RoundRows(doubles.vertex, at, 0, tile);
    RoundRows(doubles.normal, at, doubles.vertex.cols(), tile);
  }
  block.states = std::move(doubles.states);
  block.iterations = std::move(doubles.iterations);
  block.residuals = std::move(doubles.residuals);
  block.solutions = std::move(doubles.solutions);
}

}  // namespace deform
