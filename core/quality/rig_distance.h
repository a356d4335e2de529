// How far points are from what they hang on.
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/cancellation.h"
#include "core/base/thread_pool.h"
#include "core/mesh/convex_hull.h"
#include "core/mesh/rig.h"
#include "core/weights/binding.h"
#include "core/weights/cage_faces.h"

namespace deform {

// Prepared for one rig. Immutable: one object serves every thread. Lengths are
// in model units.
class RigDistance {
 public:
  // O(V) for a cage, O(n log n) for handles, whose hull it computes.
  explicit RigDistance(const Rig& rig);

  // Distance to the cage's surface, or to the surface of the handles' hull:
  // where weights are still defined, but only on one side. `at_most` may spare
  // work: of what is farther any larger number is returned.
  double ToBoundary(const Vec3& point, double at_most) const;

  // To the nearest place where weights are not differentiable: the boundary, or
  // a handle.
  double ToSingularity(const Vec3& point) const;

 private:
  std::optional<CageFaces> faces_;
  Positions handles_;  // 0 x 3 for a cage.
  std::vector<HullPlane> hull_;
};

// The smallest distance to the boundary of the rig over all points of a binding
// that have weights, model units; 0 if none has. On all threads of `pool`,
// which may be null as may `cancellation`. Cancelled.
absl::StatusOr<double> SmallestDistance(const BindingFacts& binding,
                                        ThreadPool* pool,
                                        const Cancellation* cancellation);

}  // namespace deform
