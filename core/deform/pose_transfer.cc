#include "core/deform/pose_transfer.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/deform/affine_map.h"

namespace deform {
namespace {

// The continuation of a pose outside of the handles' hull.
class Outskirts {
 public:
  Outskirts(const Rig& rig, const Pose& pose)
      : rest_(RestVertices(rig)),
        pose_(pose),
        map_(FitSimilarity(rest_, pose.vertices, DimensionOf(rig))) {}

  Vec3 operator()(const Vec3& place) const {
    const Eigen::VectorXd squares =
        (rest_.rowwise() - place.transpose()).rowwise().squaredNorm();
    Eigen::Index nearest = 0;
    const double least = squares.minCoeff(&nearest);
    if (least == 0) return pose_.vertices.row(nearest).transpose();
    Vec3 residual = Vec3::Zero();
    double sum = 0;
    for (int64_t k = 0; k < rest_.rows(); ++k) {
      const double weight = least / squares[k];
      const Vec3 rest = rest_.row(k).transpose();
      residual += weight * (pose_.vertices.row(k).transpose() - map_(rest));
      sum += weight;
    }
    return map_(place) + residual / sum;
  }

 private:
  const Positions& rest_;
  const Pose& pose_;
  const AffineMap map_;
};

bool HasWeights(PointState state) {
  return state == PointState::kInside || state == PointState::kBoundary;
}

}  // namespace

absl::StatusOr<Positions> CarriedPlaces(const Binding& binding,
                                        const Pose& pose,
                                        const PositionsRef& places) {
  DEFORM_ASSIGN_OR_RETURN(
      const auto evaluator,
      binding.scheme().Prepare(binding.rig(), binding.options()));
  WeightBlock block;
  evaluator->Evaluate(places, block);
  const Positions displacement = pose.vertices - RestVertices(binding.rig());
  const Outskirts outskirts(binding.rig(), pose);
  Positions carried = places;
  for (int64_t i = 0; i < places.rows(); ++i) {
    if (HasWeights(block.states[i])) {
      carried.row(i) += block.vertex.row(i) * displacement;
    } else {
      carried.row(i) = outskirts(places.row(i)).transpose();
    }
  }
  return carried;
}

absl::StatusOr<PoseTransfer> PoseTransfer::Create(const Binding& from,
                                                  const Binding& to,
                                                  std::vector<int32_t> previous,
                                                  const Pose& pose) {
  const Positions& before = RestVertices(from.rig());
  Pose after{.vertices = RestVertices(to.rig()),
             .stretch_blend = pose.stretch_blend};
  // Those that are elsewhere at rest.
  std::vector<int64_t> carried;
  for (int64_t k = 0; k < std::ssize(previous); ++k) {
    const int32_t old = previous[k];
    if (old >= 0 && before.row(old) == after.vertices.row(k)) {
      after.vertices.row(k) = pose.vertices.row(old);
    } else {
      carried.push_back(k);
    }
  }
  if (!carried.empty()) {
    const Positions places = after.vertices(carried, Eigen::all);
    DEFORM_ASSIGN_OR_RETURN(const Positions now,
                            CarriedPlaces(from, pose, places));
    after.vertices(carried, Eigen::all) = now;
  }
  PoseTransfer transfer(ShapeOf(from.rig()), std::move(previous),
                        std::move(after));
  for (const int64_t k : carried) {
    const int32_t old = transfer.previous_[k];
    if (old < 0) continue;
    transfer.shift_.row(k) =
        transfer.pose_.vertices.row(k) - pose.vertices.row(old);
  }
  return transfer;
}

PoseTransfer::PoseTransfer(PoseShape from, std::vector<int32_t> previous,
                           Pose pose)
    : from_(from),
      previous_(std::move(previous)),
      next_(from.rows, -1),
      shift_(Positions::Zero(std::ssize(previous_), 3)),
      pose_(std::move(pose)) {
  for (size_t k = 0; k < previous_.size(); ++k) {
    if (previous_[k] >= 0) next_[previous_[k]] = static_cast<int32_t>(k);
  }
}

Pose PoseTransfer::Transfer(const Pose& before) const {
  Pose after = pose_;
  after.stretch_blend = before.stretch_blend;
  for (int64_t k = 0; k < std::ssize(previous_); ++k) {
    if (previous_[k] < 0) continue;
    after.vertices.row(k) = before.vertices.row(previous_[k]) + shift_.row(k);
  }
  return after;
}

absl::StatusOr<PoseUpdate> PoseTransfer::Transfer(
    const PoseUpdate& before) const {
  PoseUpdate after{.stretch_blend = before.stretch_blend};
  const int64_t rows = before.positions.rows();
  after.positions.resize(rows, 3);
  for (int64_t i = 0; i < rows; ++i) {
    const int32_t row = next_[before.vertices.empty() ? i : before.vertices[i]];
    if (row < 0) continue;
    after.positions.row(std::ssize(after.vertices)) =
        before.positions.row(i) + shift_.row(row);
    after.vertices.push_back(row);
  }
  after.positions.conservativeResize(std::ssize(after.vertices), 3);
  if (after.vertices.empty() && rows > 0 && !after.stretch_blend) {
    return InvalidInput("RIG_CHANGED", "pose.vertices",
                        "the rig has changed: all handles that this pose moves "
                        "were removed");
  }
  return after;
}

}  // namespace deform
