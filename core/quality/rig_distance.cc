#include "core/quality/rig_distance.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

namespace deform {

RigDistance::RigDistance(const Rig& rig) : handles_(0, 3) {
  if (const Cage* cage = std::get_if<Cage>(&rig)) {
    faces_.emplace(*cage);
  } else {
    handles_ = RestVertices(rig);
    hull_ = HullPlanes(handles_, DimensionOf(rig));
  }
}

double RigDistance::ToBoundary(const Vec3& point, double at_most) const {
  if (faces_) return faces_->NearestWithin(point, at_most).distance;
  double distance = std::numeric_limits<double>::infinity();
  for (const HullPlane& plane : hull_) {
    distance = std::min(distance, std::abs(plane.Height(point)));
  }
  return distance;
}

double RigDistance::ToSingularity(const Vec3& point) const {
  double distance = ToBoundary(point, std::numeric_limits<double>::infinity());
  for (int64_t i = 0; i < handles_.rows(); ++i) {
    distance = std::min(distance, (handles_.row(i).transpose() - point).norm());
  }
  return distance;
}

absl::StatusOr<double> SmallestDistance(const BindingFacts& binding,
                                        ThreadPool* pool,
                                        const Cancellation* cancellation) {
  constexpr int64_t kPointsPerBlock = 1024;
  const RigDistance distance(binding.rig());
  const Positions& points = binding.model()->positions();
  const std::vector<int64_t>& fixed = binding.fixed_points();
  // What one block has found spares the others work.
  std::atomic<double> smallest = std::numeric_limits<double>::infinity();
  const auto measure = [&](int64_t index) {
    double found = smallest;
    const int64_t first = index * kPointsPerBlock;
    const int64_t end = std::min(first + kPointsPerBlock, points.rows());
    for (int64_t i = first; i < end; ++i) {
      if (std::binary_search(fixed.begin(), fixed.end(), i)) continue;
      found = std::min(found, distance.ToBoundary(points.row(i), found));
    }
    double known = smallest;
    while (found < known && !smallest.compare_exchange_weak(known, found)) {
    }
  };
  const int64_t blocks =
      (points.rows() + kPointsPerBlock - 1) / kPointsPerBlock;
  if (!ParallelFor(pool, blocks, cancellation, measure)) {
    return absl::CancelledError("the quality report was cancelled");
  }
  return std::isfinite(smallest) ? smallest.load() : 0;
}

}  // namespace deform
