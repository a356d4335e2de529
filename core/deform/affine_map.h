// The rigid part of a pose.
#pragma once

#include "core/kernels/map_points.h"
#include "core/mesh/types.h"

namespace deform {

// x -> linear (x - from) + to. Two centres instead of one offset keep the
// digits of models far from the origin.
struct AffineMap {
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Vec3 from = Vec3::Zero();
  Vec3 to = Vec3::Zero();
  Vec3 operator()(const Vec3& x) const { return linear * (x - from) + to; }
};

// The same, seen from `origin`.
PointMap PointMapOf(const AffineMap& map, const Vec3& origin);

// The similarity (rotation, uniform scale, translation; never a reflection)
// that maps the rows of `rest` to those of `posed` best in the least-squares
// sense; in 2D within the plane. Exactly the identity if nothing moved.
// Source: Umeyama, "Least-squares estimation of transformation parameters
// between two point patterns", PAMI 13(4), 1991.
AffineMap FitSimilarity(const PositionsRef& rest, const PositionsRef& posed,
                        int dimension);

}  // namespace deform
