#include "core/weights/cage_edges.h"

#include <algorithm>
#include <map>
#include <utility>

namespace deform {

CageEdges::CageEdges(const Cage& cage) : of_face(cage.face_count()) {
  std::map<std::pair<int32_t, int32_t>, int32_t> index;
  for (int64_t f = 0; f < cage.face_count(); ++f) {
    for (int q = 0; q < 3; ++q) {
      const int32_t from = cage.faces()(f, (q + 1) % 3);
      const int32_t to = cage.faces()(f, (q + 2) % 3);
      const auto [at, is_new] = index.emplace(
          std::minmax(from, to), static_cast<int32_t>(edges.size()));
      if (is_new) edges.push_back({from, to});
      of_face[f][q] = at->second;
    }
  }
}

}  // namespace deform
