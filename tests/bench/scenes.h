// Generated models and cages that measurements are made on.
#pragma once

#include <cstdint>

#include "core/mesh/cage.h"
#include "core/mesh/handles.h"
#include "core/mesh/types.h"

namespace deform::bench {

// A ball in `rings` x `segments`, dented like an organ: V = rings x segments +
// 2, F = 2 x rings x segments. 9 x 12 makes the 110/216 of [L08].
Cage OrganCage(int rings, int segments);

// `count` points on spirals over a surface like that of OrganCage, at 0.8 of
// its size: neighbours in space are close in order, as in most meshes.
Positions OrganPoints(int64_t count);

// Handles spread evenly around the organ.
Handles HandlesAround(int64_t count);

// A closed loop of `corners` around the origin, dented likewise, and `count`
// points in rows within it.
Cage LeafCage(int corners);
Positions LeafPoints(int64_t count);

}  // namespace deform::bench
