// The triangle of three points, in forms that keep their digits when it is
// thin.
#pragma once

#include <algorithm>

#include <Eigen/Geometry>

#include "core/mesh/types.h"

namespace deform {

// Normal of (a, b, c), of length twice the area; it points to where the corners
// run counter-clockwise. The cross product of the two shortest edges: its error
// is eps times their product, where the long edges of a needle would lose the
// area to rounding.
inline Vec3 AreaVector(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a;
  const Vec3 bc = c - b;
  const Vec3 ca = a - c;
  const double lab = ab.squaredNorm();
  const double lbc = bc.squaredNorm();
  const double lca = ca.squaredNorm();
  const double longest = std::max({lab, lbc, lca});
  if (longest == lca) return ab.cross(bc);
  if (longest == lbc) return ca.cross(ab);
  return bc.cross(ca);
}

}  // namespace deform
