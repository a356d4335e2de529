// Points grouped by where they are.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh/types.h"
#include "core/weights/blocks.h"

namespace deform {

// Cuts order[range] into `parts` clusters of about the same number of points by
// planes across the longest side of their box, again and again, and reorders it
// so that each is a range of it. All but the last begin and end at multiples of
// `unit` counted from the range's first. Ties go by index: the same points give
// the same clusters.
std::vector<Block> CutIntoClusters(const Positions& points, int64_t parts,
                                   int64_t unit, Block range,
                                   std::span<int32_t> order);

}  // namespace deform
