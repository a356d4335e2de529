// The loops of 2D cages.
#pragma once

#include "absl/status/statusor.h"
#include "core/mesh/types.h"

namespace deform {

// `edges` (E x 2) with each loop turned as a cage needs it, the domain on the
// left: loops that lie within an even number of others run counter-clockwise,
// the rest, holes, clockwise. The order of the edges stays. `vertices` is V x 3
// with z = 0. Refuses with InvalidArgument what is not made of loops:
// INDEX_OUT_OF_RANGE, DEGENERATE_FACE, CAGE_NOT_CLOSED, CAGE_NOT_MANIFOLD.
// O(E) a loop.
absl::StatusOr<Faces> OrientLoops(const Positions& vertices, Faces edges);

}  // namespace deform
