// Models in a cube to bind.
#pragma once

#include <cstring>
#include <memory>
#include <utility>

#include "core/kernels/weight_tiles.h"
#include "core/weights/binding.h"
#include "tests/support/shapes.h"

namespace deform {

inline std::shared_ptr<const Mesh> Shared(Mesh mesh) {
  return std::make_shared<const Mesh>(std::move(mesh));
}

inline Cage Cube() { return CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})); }

inline BindRequest SphereInCube() {
  return {.model = Shared(MeshOf(Icosphere(0.9, 3))),
          .rig = Cube(),
          .scheme = "green"};
}

// Points along x with no edges: point i at x = i / 4, inside the cube up to 3,
// on its boundary at 4.
inline BindRequest RowOfPoints(int count) {
  Shape points{Positions::Zero(count, 3), Faces(0, 3)};
  for (int i = 0; i < count; ++i) points.positions(i, 0) = 0.25 * i;
  return {.model = Shared(MeshOf(points)), .rig = Cube(), .scheme = "green"};
}

inline bool SameBits(const WeightTiles& a, const WeightTiles& b) {
  return a.bytes() == b.bytes() &&
         std::memcmp(a.tile(0), b.tile(0), a.bytes()) == 0;
}

}  // namespace deform
