#include "core/files/loops.h"

#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/closedness.h"
#include "core/mesh/mesh.h"
#include "core/mesh/winding.h"

namespace deform {
namespace {

constexpr char kField[] = "rig.cage.corners";

// Edges of one loop, in the order in which they follow each other.
using Loop = std::vector<int32_t>;

// Turns edges so that they follow each other; every vertex has two of them or
// none.
std::vector<Loop> Chain(int64_t vertices, Faces& edges) {
  std::vector<std::vector<int32_t>> at(vertices);
  for (int32_t e = 0; e < edges.rows(); ++e) {
    at[edges(e, 0)].push_back(e);
    at[edges(e, 1)].push_back(e);
  }
  std::vector<Loop> loops;
  std::vector<bool> taken(edges.rows(), false);
  for (int32_t first = 0; first < edges.rows(); ++first) {
    if (taken[first]) continue;
    Loop& loop = loops.emplace_back();
    for (int32_t e = first; !taken[e];) {
      taken[e] = true;
      loop.push_back(e);
      const int32_t end = edges(e, 1);
      const int32_t next = at[end][0] == e ? at[end][1] : at[end][0];
      if (edges(next, 0) != end && !taken[next]) {
        std::swap(edges(next, 0), edges(next, 1));
      }
      e = next;
    }
  }
  return loops;
}

Faces Take(const Faces& edges, const Loop& loop) {
  Faces taken(loop.size(), 2);
  for (size_t i = 0; i < loop.size(); ++i) taken.row(i) = edges.row(loop[i]);
  return taken;
}

double SignedArea(const Positions& vertices, const Faces& loop) {
  const Vec3 origin = vertices.row(loop(0, 0));
  double twice = 0;
  for (const auto& edge : loop.rowwise()) {
    const Vec3 a = vertices.row(edge[0]).transpose() - origin;
    const Vec3 b = vertices.row(edge[1]).transpose() - origin;
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2;
}

absl::Status CheckAreLoops(const Positions& vertices, const Faces& edges) {
  DEFORM_RETURN_IF_ERROR(CheckIndices(edges, vertices.rows(), kField));
  for (int64_t e = 0; e < edges.rows(); ++e) {
    if (edges(e, 0) != edges(e, 1)) continue;
    return InvalidInput("DEGENERATE_FACE", kField,
                        absl::StrCat("face ", e, " has vertex ", edges(e, 0),
                                     " as two of its corners"));
  }
  return CheckLoopsEitherWay(edges, vertices.rows(), kField);
}

}  // namespace

absl::StatusOr<Faces> OrientLoops(const Positions& vertices, Faces edges) {
  DEFORM_RETURN_IF_ERROR(CheckAreLoops(vertices, edges));
  const std::vector<Loop> loops = Chain(vertices.rows(), edges);
  std::vector<Faces> faces;
  for (const Loop& loop : loops) faces.push_back(Take(edges, loop));
  for (size_t i = 0; i < loops.size(); ++i) {
    const Vec3 corner = vertices.row(faces[i](0, 0));
    bool is_hole = false;
    for (size_t j = 0; j < loops.size(); ++j) {
      if (j == i) continue;
      const double winding = WindingNumber(vertices, faces[j], corner);
      if (std::abs(winding) > 0.5) is_hole = !is_hole;
    }
    if ((SignedArea(vertices, faces[i]) < 0) == is_hole) continue;
    for (const int32_t e : loops[i]) std::swap(edges(e, 0), edges(e, 1));
  }
  return edges;
}

}  // namespace deform
