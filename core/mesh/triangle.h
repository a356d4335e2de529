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

// The point of segment (a, b) that is closest to p; a and b may coincide.
inline Vec3 ClosestOnSegment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 along = b - a;
  const double length2 = along.squaredNorm();
  if (!(length2 > 0)) return a;
  return a + std::clamp((p - a).dot(along) / length2, 0.0, 1.0) * along;
}

// The point of triangle (a, b, c) that is closest to p; the triangle may be
// degenerate.
inline Vec3 ClosestOnTriangle(const Vec3& p, const Vec3& a, const Vec3& b,
                              const Vec3& c) {
  const Vec3 normal = AreaVector(a, b, c);
  // Signed areas of the triangles that p's projection makes with the sides.
  const double wa = (b - p).cross(c - p).dot(normal);
  const double wb = (c - p).cross(a - p).dot(normal);
  const double wc = (a - p).cross(b - p).dot(normal);
  if (wa > 0 && wb > 0 && wc > 0)
    return (wa * a + wb * b + wc * c) / (wa + wb + wc);
  Vec3 closest = ClosestOnSegment(p, a, b);
  for (const Vec3& other :
       {ClosestOnSegment(p, b, c), ClosestOnSegment(p, c, a)}) {
    if ((other - p).squaredNorm() < (closest - p).squaredNorm()) {
      closest = other;
    }
  }
  return closest;
}

}  // namespace deform
