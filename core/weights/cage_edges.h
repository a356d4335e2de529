// The edges of a 3D cage, each once for the two faces that share it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/cage.h"

namespace deform {

struct CageEdges {
  struct Edge {
    int32_t from, to;  // As the first of its faces runs through it.
  };

  explicit CageEdges(const Cage& cage);

  std::vector<Edge> edges;
  // F x 3: edge q lies opposite corner q of the face.
  std::vector<std::array<int32_t, 3>> of_face;
};

}  // namespace deform
