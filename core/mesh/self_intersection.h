// Whether a small surface runs through itself.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "core/mesh/types.h"

namespace deform {

// Two triangles of which one's side pierces the other away from common
// vertices; nullopt if there are none. Faces that merely touch or lie in one
// plane may pass. O(F^2) box tests: for cages, not for models.
std::optional<std::pair<int64_t, int64_t>> FindSelfIntersection(
    const Positions& positions, const Faces& faces);

}  // namespace deform
