// How far inside the convex hull of some handles a point lies, found from the
// planes of the hull's faces and in more digits than the solver has: the judge
// of its verdicts.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/types.h"

namespace deform {

using ExactVec3 = Eigen::Matrix<long double, 3, 1>;

// The plane through three handles that has all others on one side.
struct HullPlane {
  ExactVec3 inward;  // Unit normal.
  int64_t corner[3];
};

// Those of all faces in 3D, found by trying all triples: O(n^4) at worst. A
// plane that the rounding of long double cannot tell from one of a face is
// kept, so that distances come out too small rather than too large.
std::vector<HullPlane> HullPlanesOf(const Positions& handles);

// From the point to the nearest of the planes; negative outside.
double DepthInHull(const Positions& handles,
                   const std::vector<HullPlane>& planes, const Vec3& point);

}  // namespace deform
