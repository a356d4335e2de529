#include "tests/core/weights/hull_planes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "core/mesh/mesh.h"

namespace deform {
namespace {

ExactVec3 Exact(const Positions& handles, int64_t i) {
  return handles.row(i).transpose().cast<long double>();
}

}  // namespace

std::vector<HullPlane> HullPlanesOf(const Positions& handles) {
  std::vector<HullPlane> planes;
  const int64_t n = handles.rows();
  const long double rounding = 8 * std::numeric_limits<long double>::epsilon() *
                               BoxOf(handles).diagonal();
  for (int64_t a = 0; a < n; ++a) {
    const ExactVec3 from = Exact(handles, a);
    for (int64_t b = a + 1; b < n; ++b) {
      const ExactVec3 ab = Exact(handles, b) - from;
      for (int64_t c = b + 1; c < n; ++c) {
        const ExactVec3 ac = Exact(handles, c) - from;
        const ExactVec3 cross = ab.cross(ac);
        const long double area = cross.norm();
        if (!(area > 0)) continue;
        // A narrow triangle knows its normal less well.
        const long double slack = rounding * (ab.norm() * ac.norm() / area);
        const ExactVec3 normal = cross / area;
        long double least = 0, most = 0;
        for (int64_t i = 0; i < n && (least >= -slack || most <= slack); ++i) {
          const long double side = (Exact(handles, i) - from).dot(normal);
          least = std::min(least, side);
          most = std::max(most, side);
        }
        if (least < -slack && most > slack) continue;
        planes.push_back({most <= slack ? -normal : normal, {a, b, c}});
      }
    }
  }
  return planes;
}

double DepthInHull(const Positions& handles,
                   const std::vector<HullPlane>& planes, const Vec3& point) {
  long double depth = std::numeric_limits<long double>::infinity();
  for (const HullPlane& plane : planes) {
    const ExactVec3 offset =
        point.cast<long double>() - Exact(handles, plane.corner[0]);
    depth = std::min(depth, plane.inward.dot(offset));
  }
  return static_cast<double>(depth);
}

}  // namespace deform
