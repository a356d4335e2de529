// The convex hull of points, as the planes around it.
#pragma once

#include <vector>

#include "core/mesh/types.h"

namespace deform {

struct HullPlane {
  Vec3 normal;  // Unit, outward; in 2D within the plane z = 0.
  Vec3 point;   // Any on it.

  // Signed distance, positive outside.
  double Height(const Vec3& x) const { return normal.dot(x - point); }
};

// The planes (2D: lines) of the faces of the hull. A face with more than three
// corners comes several times. The points span their space (see Handles).
//
// Each plane has all points on its inner side, or beyond it by no more than
// 2e-12 of their extent. Quickhull: O(n log n) as a rule.
std::vector<HullPlane> HullPlanes(const PositionsRef& points, int dimension);

}  // namespace deform
