#include "core/mesh/self_intersection.h"

#include <algorithm>
#include <vector>

#include <Eigen/Geometry>

#include "core/mesh/triangle.h"

namespace deform {
namespace {

using Boxes = std::vector<Eigen::AlignedBox3d>;

bool Has(const Faces& faces, int64_t face, int32_t vertex) {
  return (faces.row(face).array() == vertex).any();
}

// Whether segment (from, to) passes through the inside of triangle (a, b, c).
bool Pierces(const Vec3& from, const Vec3& to, const Vec3& a, const Vec3& b,
             const Vec3& c) {
  const Vec3 normal = AreaVector(a, b, c);
  const double h0 = (from - a).dot(normal);
  const double h1 = (to - a).dot(normal);
  if (!((h0 < 0 && h1 > 0) || (h0 > 0 && h1 < 0))) return false;
  const Vec3 hit = from + h0 / (h0 - h1) * (to - from);
  return (b - a).cross(hit - a).dot(normal) > 0 &&
         (c - b).cross(hit - b).dot(normal) > 0 &&
         (a - c).cross(hit - c).dot(normal) > 0;
}

// Whether a side of face f without vertices of g pierces g.
bool SidePierces(const Positions& positions, const Faces& faces, int64_t f,
                 int64_t g) {
  for (int k = 0; k < 3; ++k) {
    const int32_t from = faces(f, k);
    const int32_t to = faces(f, (k + 1) % 3);
    if (Has(faces, g, from) || Has(faces, g, to)) continue;
    if (Pierces(positions.row(from), positions.row(to),
                positions.row(faces(g, 0)), positions.row(faces(g, 1)),
                positions.row(faces(g, 2)))) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::optional<std::pair<int64_t, int64_t>> FindSelfIntersection(
    const Positions& positions, const Faces& faces) {
  Boxes boxes(faces.rows());
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      boxes[f].extend(Vec3(positions.row(faces(f, k))));
    }
  }
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int64_t g = f + 1; g < faces.rows(); ++g) {
      if (!boxes[f].intersects(boxes[g])) continue;
      if (SidePierces(positions, faces, f, g) ||
          SidePierces(positions, faces, g, f)) {
        return std::pair(f, g);
      }
    }
  }
  return std::nullopt;
}

}  // namespace deform
