// How much a model encloses.
#pragma once

#include "core/mesh/types.h"

namespace deform {

enum class VolumeKind {
  // Neither of the others: the model has no faces, or they do not fit together
  // as one oriented surface.
  kNone,
  // Within a closed, oriented mesh.
  kClosed,
  // The mesh has holes, each closed by a fan of triangles around the middle of
  // its rim.
  kCapped,
  // 2D: the area of the triangles.
  kArea,
};

VolumeKind VolumeKindOf(const Faces& faces, int dimension);

// Signed: positive if faces are counter-clockwise seen from outside. 0 for
// kNone. O(N + F).
double VolumeOf(VolumeKind kind, const PositionsRef& positions,
                const Faces& faces);

}  // namespace deform
