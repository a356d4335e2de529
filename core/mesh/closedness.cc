#include "core/mesh/closedness.h"

#include <algorithm>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

// One side of a triangle. `from` < `to`; `forward` tells how the face runs.
struct Side {
  int32_t from;
  int32_t to;
  int32_t face;
  bool forward;
};

std::vector<Side> SidesOf(const Faces& faces) {
  std::vector<Side> sides;
  sides.reserve(3 * faces.rows());
  for (int32_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = faces(f, k);
      const int32_t b = faces(f, (k + 1) % 3);
      sides.push_back({std::min(a, b), std::max(a, b), f, a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return std::tie(x.from, x.to, x.face) < std::tie(y.from, y.to, y.face);
  });
  return sides;
}

// "3, 7 and 12"; a long list is cut short.
std::string ListOf(std::vector<int32_t> numbers) {
  constexpr size_t kNamed = 5;
  const size_t count = numbers.size();
  if (count > kNamed) {
    numbers.resize(kNamed);
    return absl::StrCat(absl::StrJoin(numbers, ", "), " and ", count - kNamed,
                        " more");
  }
  const int32_t last = numbers.back();
  numbers.pop_back();
  return absl::StrCat(absl::StrJoin(numbers, ", "), " and ", last);
}

std::vector<int32_t> FacesOf(std::span<const Side> sides) {
  std::vector<int32_t> faces;
  for (const Side& side : sides) faces.push_back(side.face);
  return faces;
}

// `sides` are all that lie on one edge.
absl::Status CheckEdge(std::span<const Side> sides, absl::string_view field) {
  const Side& side = sides[0];
  const std::string edge = absl::StrCat("edge ", side.from, "-", side.to);
  if (sides.size() == 1) {
    return InvalidInput("CAGE_NOT_CLOSED", field,
                        absl::StrCat(edge, " of face ", side.face,
                                     " is not shared by two faces"));
  }
  if (sides.size() > 2) {
    return InvalidInput("CAGE_NOT_MANIFOLD", field,
                        absl::StrCat(edge, " is shared by ", sides.size(),
                                     " faces: ", ListOf(FacesOf(sides))));
  }
  if (sides[0].forward == sides[1].forward) {
    return InvalidInput("CAGE_INCONSISTENT_ORIENTATION", field,
                        absl::StrCat("faces ", side.face, " and ",
                                     sides[1].face, " run the same way along ",
                                     edge, ": one of them must be turned"));
  }
  return absl::OkStatus();
}

// Sets of corners (3 f + k) that are known to belong together.
class Corners {
 public:
  explicit Corners(const Faces& faces) : faces_(faces), parent_(faces.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int64_t At(int32_t face, int32_t vertex) const {
    int k = 0;
    while (faces_(face, k) != vertex) ++k;
    return 3 * int64_t{face} + k;
  }

  int64_t Root(int64_t corner) {
    while (parent_[corner] != corner) {
      corner = parent_[corner] = parent_[parent_[corner]];
    }
    return corner;
  }

  void Join(int64_t a, int64_t b) { parent_[Root(a)] = Root(b); }

 private:
  const Faces& faces_;
  std::vector<int64_t> parent_;
};

// Every edge has two faces; `sides` holds them in pairs. Refuses vertices where
// several fans of faces touch only at the tip.
absl::Status CheckFans(const Faces& faces, const std::vector<Side>& sides,
                       int64_t vertices, absl::string_view field) {
  Corners corners(faces);
  for (size_t i = 0; i < sides.size(); i += 2) {
    for (const int32_t vertex : {sides[i].from, sides[i].to}) {
      corners.Join(corners.At(sides[i].face, vertex),
                   corners.At(sides[i + 1].face, vertex));
    }
  }
  std::vector<int64_t> fan(vertices, -1);
  for (int32_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      int64_t& first = fan[faces(f, k)];
      const int64_t root = corners.Root(3 * int64_t{f} + k);
      if (first == -1) first = root;
      if (first != root) {
        return InvalidInput(
            "CAGE_NOT_MANIFOLD", field,
            absl::StrCat("at vertex ", faces(f, k),
                         " parts of the cage touch in one point, faces ",
                         first / 3, " and ", root / 3,
                         " among them: give each part a vertex of its own"));
      }
    }
  }
  return absl::OkStatus();
}

absl::Status CheckSurface(const Faces& faces, int64_t vertices,
                          absl::string_view field) {
  const std::vector<Side> sides = SidesOf(faces);
  for (size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].from == sides[begin].from &&
           sides[end].to == sides[begin].to) {
      ++end;
    }
    DEFORM_RETURN_IF_ERROR(
        CheckEdge(std::span(sides).subspan(begin, end - begin), field));
  }
  return CheckFans(faces, sides, vertices, field);
}

// The edges at each vertex.
std::vector<std::vector<int32_t>> EdgesAtVertices(const Faces& edges,
                                                  int64_t vertices) {
  std::vector<std::vector<int32_t>> at(vertices);
  for (int32_t e = 0; e < edges.rows(); ++e) {
    at[edges(e, 0)].push_back(e);
    at[edges(e, 1)].push_back(e);
  }
  return at;
}

absl::Status CheckLoops(const Faces& edges, int64_t vertices,
                        absl::string_view field) {
  DEFORM_RETURN_IF_ERROR(CheckLoopsEitherWay(edges, vertices, field));
  const auto edges_at = EdgesAtVertices(edges, vertices);
  for (int64_t v = 0; v < vertices; ++v) {
    const std::vector<int32_t>& at = edges_at[v];
    if (at.empty()) continue;
    const bool starts = edges(at[0], 0) == v;
    if (starts == (edges(at[1], 0) == v)) {
      return InvalidInput(
          "CAGE_INCONSISTENT_ORIENTATION", field,
          absl::StrCat("edges ", at[0], " and ", at[1], " both ",
                       starts ? "start" : "end", " at vertex ", v,
                       ": one of them must be turned"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckClosed(const Faces& faces, int64_t vertices,
                         absl::string_view field) {
  return faces.cols() == 2 ? CheckLoops(faces, vertices, field)
                           : CheckSurface(faces, vertices, field);
}

absl::Status CheckLoopsEitherWay(const Faces& edges, int64_t vertices,
                                 absl::string_view field) {
  const auto edges_at = EdgesAtVertices(edges, vertices);
  for (int64_t v = 0; v < vertices; ++v) {
    const std::vector<int32_t>& at = edges_at[v];
    if (at.size() == 1) {
      return InvalidInput("CAGE_NOT_CLOSED", field,
                          absl::StrCat("vertex ", v, " belongs to edge ", at[0],
                                       " only: the loop is not closed there"));
    }
    if (at.size() > 2) {
      return InvalidInput("CAGE_NOT_MANIFOLD", field,
                          absl::StrCat("vertex ", v, " belongs to ", at.size(),
                                       " edges: ", ListOf(at)));
    }
  }
  return absl::OkStatus();
}

}  // namespace deform
