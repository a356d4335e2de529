#include "core/weights/compress_binding.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/blocks.h"
#include "core/weights/compress_weights.h"

namespace deform {
namespace {

// Rows of the dense weights of a binding.
void CopyRows(const WeightTiles& weights, std::span<const int32_t> points,
              WeightTiles& rows) {
  for (size_t i = 0; i < points.size(); ++i) {
    const float* from =
        weights.tile(points[i] / kTilePoints) + points[i] % kTilePoints;
    float* to = rows.tile(i / kTilePoints) + i % kTilePoints;
    for (int64_t c = 0; c < weights.columns(); ++c) {
      to[c * kTilePoints] = from[c * kTilePoints];
    }
  }
}

// Rows computed again, as Bind() computed them.
class RowComputation {
 public:
  RowComputation(const BindingFacts& binding,
                 std::unique_ptr<const WeightEvaluator> evaluator)
      : binding_(binding), evaluator_(std::move(evaluator)) {
    if (binding.exit_parts().empty()) return;
    exit_faces_.assign(binding.point_count(), -1);
    for (const ExitPart& part : binding.exit_parts()) {
      for (const int64_t i : part.points) exit_faces_[i] = part.exit_face;
    }
  }

  void Compute(std::span<const int32_t> points, WeightTiles& rows) const {
    const auto count = std::ssize(points);
    const int64_t step = BlockPoints(rows.columns());
    for (int64_t first = 0; first < count; first += step) {
      const auto some = points.subspan(first, std::min(step, count - first));
      Positions positions(some.size(), 3);
      for (size_t i = 0; i < some.size(); ++i)
        positions.row(i) = Point(some[i]);
      TileBlock block{.tiles = rows.tile(first / kTilePoints)};
      evaluator_->EvaluateTiles(positions, block);
    }
    if (exit_faces_.empty()) return;
    for (int64_t i = 0; i < count; ++i) {
      if (exit_faces_[points[i]] < 0) continue;
      for (const WeightShare& share :
           evaluator_->Extend(Point(points[i]), exit_faces_[points[i]])) {
        const double weight = rows.at(i, share.column);
        rows.set(i, share.column, RoundedWeight(weight + share.weight));
      }
    }
  }

 private:
  Vec3 Point(int64_t i) const { return binding_.model()->positions().row(i); }

  const BindingFacts& binding_;
  const std::unique_ptr<const WeightEvaluator> evaluator_;
  std::vector<int32_t> exit_faces_;  // N, or empty if there are none.
};

}  // namespace

std::vector<double> PoseBounds(const BindingFacts& facts) {
  std::vector<double> bounds(facts.column_count(), 1.0);
  std::fill(bounds.begin() + facts.vertex_count(), bounds.end(),
            2 / DiagonalOf(facts.rig()));
  return bounds;
}

absl::StatusOr<std::shared_ptr<const Binding>> CompressBinding(
    const BindingFacts& facts, const WeightTiles* dense, double tolerance,
    const BindControl& control, std::shared_ptr<const Solutions> solutions) {
  DEFORM_ASSIGN_OR_RETURN(auto evaluator,
                          facts.scheme().Prepare(facts.rig(), facts.options()));
  const RowComputation computation(facts, std::move(evaluator));
  const WeightSource source{
      .points = &facts.model()->positions(),
      .without_weights = facts.fixed_points(),
      .scale = PoseBounds(facts),
      .rows = [&](std::span<const int32_t> points, WeightTiles& rows) {
        if (dense != nullptr) {
          CopyRows(*dense, points, rows);
        } else {
          computation.Compute(points, rows);
        }
      }};
  DEFORM_ASSIGN_OR_RETURN(
      CompressedWeights weights,
      CompressWeights(source, tolerance,
                      {.pool = control.pool,
                       .cancellation = control.cancellation,
                       .points_done = control.points_done,
                       .max_bytes = control.max_weight_bytes}));
  return std::make_shared<const Binding>(
      facts, std::make_shared<const CompressedWeights>(std::move(weights)),
      std::move(solutions));
}

absl::Status CheckWeightTolerance(double tolerance) {
  if (tolerance == 0 ||
      (tolerance >= kFinestTolerance && tolerance <= kCoarsestTolerance)) {
    return absl::OkStatus();
  }
  return InvalidInput(
      "WEIGHT_TOLERANCE_OUT_OF_RANGE", "weight_tolerance",
      absl::StrCat("weight tolerance must be 0 (dense weights) or in [",
                   kFinestTolerance, ", ", kCoarsestTolerance, "], not ",
                   tolerance));
}

bool WorthCompressing(int64_t dense_bytes) {
  constexpr int64_t kCacheBytes = int64_t{4} << 20;
  return dense_bytes > kCacheBytes;
}

}  // namespace deform
