// How often closed oriented faces wind around a point.
#pragma once

#include <cstdint>

#include "core/mesh/types.h"

namespace deform {

// Sum over all faces but `skip` (-1 for none) of the solid angle / 4 pi, or in
// 2D (faces of two corners) of the angle / 2 pi, under which `point` sees them.
// Closed, outward oriented faces give 1 inside and 0 outside; a face that the
// point lies on counts 0, so that at the centroid of a face of a right cage the
// sum is 1/2. Exact to about 1e-15 per face at any distance. O(F).
double WindingNumber(const PositionsRef& vertices, const Faces& faces,
                     const Vec3& point, int64_t skip = -1);

}  // namespace deform
