#include "core/quality/pose_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/status_macros.h"

namespace deform {
namespace {

// Of the distance to the nearest singularity. Truncation is the fourth power,
// 1e-11 of what is left of the pose, rounding 1e-15 over the step.
constexpr double kStep = 1.0 / 512;
// In steps, and their factors in 12 h g' = 8 (g1 - g-1) - (g2 - g-2).
constexpr int kSteps[] = {1, -1, 2, -2};
constexpr double kFactors[] = {8, -8, -1, 1};

double PowerOfTwoBelow(double x) { return std::exp2(std::ilogb(x)); }

bool HasWeights(PointState state) {
  return state == PointState::kInside || state == PointState::kBoundary ||
         state == PointState::kBoundOutside;
}

}  // namespace

absl::StatusOr<std::unique_ptr<const PoseMap>> PoseMap::Create(
    const BindingFacts& binding, const Pose& pose) {
  DEFORM_ASSIGN_OR_RETURN(
      auto evaluator,
      binding.scheme().Prepare(binding.rig(), binding.options()));
  return std::unique_ptr<const PoseMap>(
      new PoseMap(binding, std::move(evaluator), pose));
}

PoseMap::PoseMap(const BindingFacts& binding,
                 std::unique_ptr<const WeightEvaluator> evaluator,
                 const Pose& pose)
    : binding_(binding),
      evaluator_(std::move(evaluator)),
      distance_(binding_.rig()) {
  const PosedColumns posed(binding_.rig(), binding_.scheme().uses_normals());
  posed.UpdateAll(pose, residuals_);
  map_ =
      FitSimilarity(RestVertices(binding_.rig()), pose.vertices, dimension());
  for (int64_t c = 0; c < residuals_.rows(); ++c) {
    const Vec3 rest = posed.rest().row(c);
    residuals_.row(c) -=
        (c < posed.vertex_count() ? map_(rest) : map_.linear * rest)
            .transpose();
  }
  if (binding_.exit_parts().empty()) return;
  exit_face_.assign(binding_.point_count(), -1);
  for (const ExitPart& part : binding_.exit_parts()) {
    for (const int64_t i : part.points) exit_face_[i] = part.exit_face;
  }
}

std::vector<Derivative> PoseMap::Differentiate(
    std::span<const int64_t> points) const {
  std::vector<Derivative> derivatives(points.size());
  std::vector<size_t> by_differences;
  const double near = kNearRig * DiagonalOf(binding_.rig());
  const std::vector<int64_t>& fixed = binding_.fixed_points();
  for (size_t k = 0; k < points.size(); ++k) {
    if (std::binary_search(fixed.begin(), fixed.end(), points[k])) continue;
    if (distance_.ToBoundary(Point(points[k]), near) < near) {
      derivatives[k].measured = Measured::kNearRig;
    } else if (!InClosedForm(points[k], derivatives[k])) {
      by_differences.push_back(k);
    }
  }
  if (!by_differences.empty()) {
    ByDifferences(points, by_differences, derivatives);
  }
  return derivatives;
}

bool PoseMap::InClosedForm(int64_t point, Derivative& derivative) const {
  const int64_t vertices = binding_.vertex_count();
  Positions gradients(residuals_.rows(), 3);
  if (!evaluator_->Differentiate(
          Point(point), exit_face_.empty() ? -1 : exit_face_[point],
          gradients.topRows(vertices),
          gradients.bottomRows(gradients.rows() - vertices))) {
    return false;
  }
  derivative.measured = Measured::kYes;
  derivative.jacobian.topLeftCorner(dimension(), dimension()) =
      (map_.linear + residuals_.transpose() * gradients)
          .topLeftCorner(dimension(), dimension());
  return true;
}

void PoseMap::ByDifferences(std::span<const int64_t> points,
                            std::span<const size_t> rows,
                            std::vector<Derivative>& derivatives) const {
  const int per_point = dimension() * std::ssize(kSteps);
  const double near = kNearRig * DiagonalOf(binding_.rig());
  std::vector<double> steps;
  std::vector<size_t> measured;
  Positions places(std::ssize(rows) * per_point, 3);
  for (const size_t k : rows) {
    const Vec3 point = Point(points[k]);
    const double distance = distance_.ToSingularity(point);
    derivatives[k].measured = Measured::kNearRig;
    if (!(distance >= near)) continue;
    const double step = PowerOfTwoBelow(kStep * distance);
    int64_t row = std::ssize(measured) * per_point;
    for (int d = 0; d < dimension(); ++d) {
      for (const int s : kSteps) {
        places.row(row++) = (point + s * step * Vec3::Unit(d)).transpose();
      }
    }
    steps.push_back(step);
    measured.push_back(k);
  }
  WeightBlock block;
  evaluator_->Evaluate(places.topRows(std::ssize(measured) * per_point), block);
  const int64_t vertices = binding_.vertex_count();
  Positions moved = block.vertex * residuals_.topRows(vertices);
  if (block.normal.cols() > 0) {
    moved += block.normal * residuals_.bottomRows(block.normal.cols());
  }
  for (size_t m = 0; m < measured.size(); ++m) {
    Derivative& derivative = derivatives[measured[m]];
    int64_t row = static_cast<int64_t>(m) * per_point;
    bool complete = true;
    Eigen::Matrix3d jacobian = map_.linear;
    for (int d = 0; d < dimension(); ++d) {
      for (const double factor : kFactors) {
        complete &= HasWeights(block.states[row]);
        jacobian.col(d) +=
            factor / (12 * steps[m]) * moved.row(row++).transpose();
      }
    }
    if (!complete) continue;
    derivative.measured = Measured::kYes;
    derivative.jacobian.topLeftCorner(dimension(), dimension()) =
        jacobian.topLeftCorner(dimension(), dimension());
  }
}

}  // namespace deform
