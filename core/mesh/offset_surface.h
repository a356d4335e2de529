// The surface at a distance around a model.
#pragma once

#include "core/mesh/distance_grid.h"
#include "core/mesh/triangle_surface.h"

namespace deform {

// The outer surface at `distance` from the model of `grid`: closed, manifold,
// oriented outward, with the model inside; hollows that cannot be reached from
// the lattice's border are filled. The grid must reach further than `distance`
// beyond the model. O(nodes).
TriangleSurface OffsetSurface(const DistanceGrid& grid, double distance);

}  // namespace deform
