// The space map of a posed rig, x(eta), and its derivative.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/deform/affine_map.h"
#include "core/deform/columns.h"
#include "core/deform/pose.h"
#include "core/quality/rig_distance.h"
#include "core/weights/binding.h"

namespace deform {

// What there is to know at a point of the model.
enum class Measured : uint8_t {
  kYes,
  // Nearer to the boundary of the rig, or to a handle, than kNearRig: the map
  // has no derivative there, or none that doubles could tell.
  kNearRig,
  // It has no weights: it rests in every pose.
  kFixed,
};

// In units of D.
inline constexpr double kNearRig = 1e-7;

struct Derivative {
  Measured measured = Measured::kFixed;
  // dx / deta; in 2D its upper left 2 x 2, the rest 0.
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
};

// Of a binding under a pose, with the weights in double. Immutable: one object
// serves every thread.
class PoseMap {
 public:
  // `pose` is right (CheckPoseUpdate).
  static absl::StatusOr<std::unique_ptr<const PoseMap>> Create(
      const BindingFacts& binding, const Pose& pose);

  // The derivative at each of the model's `points`, preferably neighbours.
  //
  // In closed form where the scheme has one. Else by central differences of
  // fourth order: twelve evaluations (2D: eight) at steps of 1/512 of the
  // distance R to the nearest singularity, and rounded down to a power of two,
  // which is exact. With weights known to 1e-15 the error is about 1e-12 D / R.
  std::vector<Derivative> Differentiate(std::span<const int64_t> points) const;

 private:
  PoseMap(const BindingFacts& binding,
          std::unique_ptr<const WeightEvaluator> evaluator, const Pose& pose);

  int dimension() const { return binding_.dimension(); }
  Vec3 Point(int64_t i) const { return binding_.model()->positions().row(i); }
  // False if the scheme has no closed form.
  bool InClosedForm(int64_t point, Derivative& derivative) const;
  // Those of `derivatives` named by `rows`.
  void ByDifferences(std::span<const int64_t> points,
                     std::span<const size_t> rows,
                     std::vector<Derivative>& derivatives) const;

  const BindingFacts binding_;
  const std::unique_ptr<const WeightEvaluator> evaluator_;
  const RigDistance distance_;
  AffineMap map_;                   // The similarity that fits the pose best.
  Columns residuals_;               // What of the columns it leaves.
  std::vector<int32_t> exit_face_;  // N, or empty.
};

}  // namespace deform
