// On which side of a line or plane a point lies, where rounding lets one tell.
//
// Source: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast
//   Robust Geometric Predicates", DCG 18, 1997: the bounds of the first stage.
// Departs: what that stage cannot decide counts as 0, "on it".
#pragma once

#include <cmath>

#include "core/mesh/types.h"

namespace deform {

// 1 if `p` lies where the normal of (a, b, c) points, that is, sees the corners
// run counter-clockwise; -1 on the other side; 0 within rounding of the plane.
// Never wrong for coordinates up to 1e100 and distances from 1e-100.
inline int SideOfPlane(const Vec3& a, const Vec3& b, const Vec3& c,
                       const Vec3& p) {
  const Vec3 u = a - p;
  const Vec3 v = b - p;
  const Vec3 w = c - p;
  const double vw = v.x() * w.y(), wv = w.x() * v.y();
  const double wu = w.x() * u.y(), uw = u.x() * w.y();
  const double uv = u.x() * v.y(), vu = v.x() * u.y();
  const double det = u.z() * (vw - wv) + v.z() * (wu - uw) + w.z() * (uv - vu);
  const double size = std::abs(u.z()) * (std::abs(vw) + std::abs(wv)) +
                      std::abs(v.z()) * (std::abs(wu) + std::abs(uw)) +
                      std::abs(w.z()) * (std::abs(uv) + std::abs(vu));
  // (7 + 56 eps) eps in the paper, eps = 2^-53.
  if (!(std::abs(det) > 8e-16 * size)) return 0;
  return det < 0 ? 1 : -1;
}

// The same in the plane z = 0: 1 if `p` lies left of the line from a to b.
inline int SideOfLine(const Vec3& a, const Vec3& b, const Vec3& p) {
  const double left = (a.x() - p.x()) * (b.y() - p.y());
  const double right = (a.y() - p.y()) * (b.x() - p.x());
  const double det = left - right;
  // (3 + 16 eps) eps in the paper.
  if (!(std::abs(det) > 4e-16 * (std::abs(left) + std::abs(right)))) return 0;
  return det > 0 ? 1 : -1;
}

}  // namespace deform
