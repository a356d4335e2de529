// What kernels that take one point per vector lane are given.
#pragma once

#include <cstdint>

#include "core/kernels/weight_tiles.h"

namespace deform {

// The points of one tile, and what became of them.
struct LanePoints {
  // x of all points, then y, then z. Lanes from `count` on must hold numbers;
  // what is computed for them has no meaning.
  alignas(64) double at[3][kTilePoints];
  int64_t count;  // 1 to kTilePoints.

  // Out, a bit a lane. Weights of lanes that are not solved have no meaning:
  // they go the plain way.
  uint32_t solved;
  uint32_t inside;
};

}  // namespace deform
