// Whether a surface or a set of loops runs through itself.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "core/mesh/types.h"

namespace deform {

// Two faces that cross: triangles (F x 3) along a piece of a line, edges in the
// plane z = 0 (F x 2) in a point inside of both. The lower one comes first;
// nullopt if there are none. Never finds a pair that does not cross; faces that
// touch, lie in one plane, or cross by no more than rounding may pass.
//
// Pairs whose boxes overlap along the longest axis are looked at, F^1.5 for
// even triangulations, and 1e8 (a second) at most: then the rest may pass.
std::optional<std::pair<int64_t, int64_t>> FindSelfIntersection(
    const Positions& positions, const Faces& faces);

}  // namespace deform
