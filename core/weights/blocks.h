// How the points of a model are cut into pieces of work.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/kernels/weight_tiles.h"

namespace deform {

struct Block {
  int64_t first;
  int64_t count;
};

// Points of one piece of work: some milliseconds, whole tiles, and few enough
// that their weights in double stay in the cache. Depends on the number of
// weight columns alone, so that schemes which start from a neighbour's solution
// come out the same again.
inline int64_t BlockPoints(int64_t columns) {
  const int64_t tiles = 80000 / columns / kTilePoints;
  return kTilePoints * std::clamp<int64_t>(tiles, 1, 16);
}

inline Block BlockAt(int64_t index, int64_t block_points, int64_t points) {
  const int64_t first = index * block_points;
  return {first, std::min(block_points, points - first)};
}

}  // namespace deform
