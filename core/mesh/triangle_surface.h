// Triangles that are neither a model nor a cage yet.
#pragma once

#include "core/mesh/types.h"

namespace deform {

struct TriangleSurface {
  Positions positions;
  Faces faces;  // F x 3.
};

}  // namespace deform
