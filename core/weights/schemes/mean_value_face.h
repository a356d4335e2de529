// What a point has by one face of a cage in mean value coordinates: the plain
// formulas, with all care.
#pragma once

#include <array>

#include "core/mesh/types.h"
#include "core/weights/cage_faces.h"

namespace deform {

// Shares of the corners of a directed edge of a 2D cage; the third is 0.
std::array<double, 3> MeanValueOfEdge(const CageFaces::Face& edge,
                                      const Vec3& eta);
// Shares of the corners of a triangle of a 3D cage.
std::array<double, 3> MeanValueOfTriangle(const CageFaces::Face& face,
                                          const Vec3& eta);

}  // namespace deform
