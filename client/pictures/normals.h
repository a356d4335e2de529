// Normals to shade a triangle mesh with.
#pragma once

#include "core/mesh/types.h"

namespace deform {

// A unit normal per corner of every face, (3 F) x 3: the mean of the faces
// around the vertex, by area, that lie within `crease_degrees` of this one. So
// round things look round and edges stay edges. A face without area gets 0.
Positions CornerNormals(const PositionsRef& positions, const Faces& faces,
                        double crease_degrees);

}  // namespace deform
