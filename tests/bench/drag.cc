#include "tests/bench/drag.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace deform::bench {

Pose Bent(const Rig& rig, int step) {
  Pose pose = RestPose(rig);
  for (int64_t v = 0; v < pose.vertices.rows(); ++v) {
    auto x = pose.vertices.row(v);
    x(2) += 0.2 * std::sin(x(0) + 0.1 * step);
    x(1) *= 1 + 0.1 * std::sin(x(2) + step);
  }
  return pose;
}

Drag::Drag(std::shared_ptr<const Binding> binding, double share, Kind kind)
    : binding_(std::move(binding)),
      deformer_(binding_, nullptr),
      pose_(Bent(binding_->rig(), 0)),
      order_(pose_.vertices.rows()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (kind == Kind::kScattered) {
    std::ranges::shuffle(order_, std::mt19937(5));
  }
  deformer_.MoveTo(pose_, Deformer::Path::kFull);
  const double wanted = share * static_cast<double>(binding_->column_count());
  // Which columns move does not depend on how they are applied.
  const PosedColumns posed(binding_->rig(), binding_->scheme().uses_normals());
  Columns columns = posed.rest();
  std::vector<int32_t> vertices;
  while (columns_ < wanted && moved_ < std::ssize(order_)) {
    vertices.push_back(static_cast<int32_t>(order_[moved_++]));
    columns_ =
        static_cast<double>(posed.Update(pose_, vertices, columns).size());
  }
  if (kind == Kind::kOthers) groups_ = std::ssize(order_) / moved_;
  // Less than three groups are soon known; a full pass is no delta.
  if (kind == Kind::kOthers && groups_ < 3) columns_ = 0;
  for (int k = 0; k < 3 && possible(); ++k) Step();
}

void Drag::Step() {
  const int64_t group = step_++ % groups_;
  const double sign = step_ / groups_ % 2 == 0 ? 1 : -1;
  for (int64_t k = group * moved_; k < (group + 1) * moved_; ++k) {
    pose_.vertices.row(order_[k]).array() += 0.01 * sign;
  }
  deformer_.MoveTo(pose_);
}

double Drag::Error() const {
  Deformer full(binding_, nullptr);
  full.MoveTo(pose_, Deformer::Path::kFull);
  return (full.positions() - deformer_.positions())
             .rowwise()
             .norm()
             .maxCoeff() /
         DiagonalOf(binding_->rig());
}

}  // namespace deform::bench
