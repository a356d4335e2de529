// Source: Guigue, Devillers, "Fast and Robust Triangle-Triangle Overlap Test
//   Using Orientation Predicates", JGT 8(1), 2003: where each triangle reaches
//   both sides of the other's plane, both meet the common line of the planes in
//   an interval, and signs of determinants of corners tell whether the
//   intervals overlap.
// Departs: neighbours that share a vertex are decided by the directions in
//   which their intervals leave it.
#include "core/mesh/self_intersection.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "core/mesh/side.h"

namespace deform {
namespace {

constexpr int64_t kMaxPairs = 100'000'000;

// Corners in one of the orders that keep or turn the triangle's orientation.
struct Triangle {
  std::array<int32_t, 3> corner;

  void Rotate(int first) {
    std::rotate(corner.begin(), corner.begin() + first, corner.end());
  }
  void Turn() { std::swap(corner[1], corner[2]); }
  bool Has(int32_t vertex) const {
    return std::find(corner.begin(), corner.end(), vertex) != corner.end();
  }
};

using Sides = std::array<int, 3>;

bool ReachesBothSides(const Sides& sides) {
  return *std::min_element(sides.begin(), sides.end()) < 0 &&
         *std::max_element(sides.begin(), sides.end()) > 0;
}

class Crossings {
 public:
  Crossings(const Positions& positions, const Faces& faces)
      : positions_(positions), faces_(faces) {}

  bool Cross(int64_t f, int64_t g) const {
    return faces_.cols() == 2 ? EdgesCross(f, g) : TrianglesCross(f, g);
  }

 private:
  Vec3 At(int32_t vertex) const { return positions_.row(vertex); }

  int Side(const Triangle& t, int32_t vertex) const {
    if (t.Has(vertex)) return 0;
    return SideOfPlane(At(t.corner[0]), At(t.corner[1]), At(t.corner[2]),
                       At(vertex));
  }

  Sides SidesOf(const Triangle& corners, const Triangle& plane) const {
    return {Side(plane, corners.corner[0]), Side(plane, corners.corner[1]),
            Side(plane, corners.corner[2])};
  }

  bool EdgesCross(int64_t f, int64_t g) const {
    const int32_t a = faces_(f, 0), b = faces_(f, 1);
    const int32_t c = faces_(g, 0), d = faces_(g, 1);
    if (a == c || a == d || b == c || b == d) return false;
    const auto apart = [&](int32_t from, int32_t to, int32_t p, int32_t q) {
      return SideOfLine(At(from), At(to), At(p)) *
                 SideOfLine(At(from), At(to), At(q)) <
             0;
    };
    return apart(a, b, c, d) && apart(c, d, a, b);
  }

  bool TrianglesCross(int64_t f, int64_t g) const {
    Triangle a{{faces_(f, 0), faces_(f, 1), faces_(f, 2)}};
    Triangle b{{faces_(g, 0), faces_(g, 1), faces_(g, 2)}};
    // With two vertices shared, no side has corners left on both sides.
    const Sides a_sides = SidesOf(a, b);
    if (!ReachesBothSides(a_sides)) return false;
    const Sides b_sides = SidesOf(b, a);
    if (!ReachesBothSides(b_sides)) return false;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        if (a.corner[i] != b.corner[j]) continue;
        // From the shared vertex, with n the normals, one interval runs along
        // n_a x n_b if a's next corner is above b's plane, else against it; the
        // other one the other way round.
        return a_sides[(i + 1) % 3] != b_sides[(j + 1) % 3];
      }
    }
    return IntervalsOverlap(a, a_sides, b, b_sides);
  }

  // Brings the corner to the front that is alone on its side of the other
  // triangle's plane, and tells the side.
  static int BringLonelyToFront(Triangle& t, const Sides& sides) {
    const int sum = sides[0] + sides[1] + sides[2];
    const int side = sum > 0 ? -1 : 1;
    const auto at = std::find(sides.begin(), sides.end(), side);
    t.Rotate(static_cast<int>(at - sides.begin()));
    return side;
  }

  bool IntervalsOverlap(Triangle a, const Sides& a_sides, Triangle b,
                        const Sides& b_sides) const {
    const int a_side = BringLonelyToFront(a, a_sides);
    const int b_side = BringLonelyToFront(b, b_sides);
    // Each shall see the other's first corner above.
    if (a_side < 0) b.Turn();
    if (b_side < 0) a.Turn();
    const auto& [a0, a1, a2] = a.corner;
    const auto& [b0, b1, b2] = b.corner;
    return SideOfPlane(At(a0), At(a1), At(b0), At(b1)) < 0 &&
           SideOfPlane(At(a0), At(a2), At(b2), At(b0)) < 0;
  }

  const Positions& positions_;
  const Faces& faces_;
};

// Boxes of the faces, by where they begin along the longest axis.
struct FaceBox {
  std::array<double, 3> min;  // The longest axis first.
  std::array<double, 3> max;
  int64_t face;

  bool Overlaps(const FaceBox& other) const {
    return min[1] <= other.max[1] && other.min[1] <= max[1] &&
           min[2] <= other.max[2] && other.min[2] <= max[2];
  }
};

std::vector<FaceBox> SortedBoxes(const Positions& positions,
                                 const Faces& faces) {
  int longest = 0;
  (positions.colwise().maxCoeff() - positions.colwise().minCoeff())
      .maxCoeff(&longest);
  std::vector<FaceBox> boxes(faces.rows());
  for (int64_t f = 0; f < faces.rows(); ++f) {
    boxes[f].face = f;
    for (int i = 0; i < 3; ++i) {
      const int axis = (longest + i) % 3;
      const auto at = [&](int k) { return positions(faces(f, k), axis); };
      const auto [low, high] = faces.cols() == 2
                                   ? std::minmax({at(0), at(1)})
                                   : std::minmax({at(0), at(1), at(2)});
      boxes[f].min[i] = low;
      boxes[f].max[i] = high;
    }
  }
  std::sort(boxes.begin(), boxes.end(), [](const auto& a, const auto& b) {
    return std::pair(a.min[0], a.face) < std::pair(b.min[0], b.face);
  });
  return boxes;
}

}  // namespace

std::optional<std::pair<int64_t, int64_t>> FindSelfIntersection(
    const Positions& positions, const Faces& faces) {
  const Crossings crossings(positions, faces);
  const std::vector<FaceBox> boxes = SortedBoxes(positions, faces);
  int64_t left = kMaxPairs;
  for (size_t i = 0; i < boxes.size(); ++i) {
    for (size_t j = i + 1;
         j < boxes.size() && boxes[j].min[0] <= boxes[i].max[0]; ++j) {
      if (--left < 0) return std::nullopt;
      if (!boxes[i].Overlaps(boxes[j])) continue;
      const auto pair = std::minmax(boxes[i].face, boxes[j].face);
      if (crossings.Cross(pair.first, pair.second)) return pair;
    }
  }
  return std::nullopt;
}

}  // namespace deform
