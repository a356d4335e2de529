// Cages around the box [-1, 1]^dimension.
#pragma once

#include "core/mesh/cage.h"
#include "tests/support/shapes.h"

namespace deform {

// Each side a grid of cells x cells squares.
inline Cage BoxCage(int cells = 1) {
  const int counts[3] = {cells, cells, cells};
  return CageOf(Bar(Vec3(-1, -1, -1), Vec3(1, 1, 1), counts));
}

inline Cage SquareCage() {
  const Eigen::Vector2d corners[] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  return CageOf(Loop2d(corners));
}

}  // namespace deform
