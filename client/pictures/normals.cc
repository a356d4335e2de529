#include "client/pictures/normals.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

namespace deform {
namespace {

// Faces around vertex v: corner[first[v] .. first[v + 1]) / 3.
struct Incidence {
  Incidence(const Faces& faces, int64_t vertices)
      : first(vertices + 1, 0), corner(faces.size()) {
    for (int64_t i = 0; i < faces.size(); ++i) ++first[faces.data()[i] + 1];
    for (int64_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
    std::vector<int64_t> next(first.begin(), first.end() - 1);
    for (int64_t i = 0; i < faces.size(); ++i) {
      corner[next[faces.data()[i]]++] = i;
    }
  }
  std::vector<int64_t> first;
  std::vector<int64_t> corner;
};

}  // namespace

Positions CornerNormals(const PositionsRef& positions, const Faces& faces,
                        double crease_degrees) {
  Positions area(faces.rows(), 3);  // Area times normal.
  Positions unit(faces.rows(), 3);
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Vec3 a = positions.row(faces(f, 0));
    const Vec3 b = positions.row(faces(f, 1));
    const Vec3 c = positions.row(faces(f, 2));
    const Vec3 normal = (b - a).cross(c - a);
    const double length = normal.stableNorm();
    area.row(f) = normal;
    unit.row(f) = length > 0 ? Vec3(normal / length) : Vec3::Zero();
  }
  const double threshold = std::cos(crease_degrees * std::numbers::pi / 180);
  const Incidence around(faces, positions.rows());
  Positions normals(faces.size(), 3);
  for (int64_t i = 0; i < faces.size(); ++i) {
    const int32_t vertex = faces.data()[i];
    const Vec3 own = unit.row(i / 3);
    Vec3 sum = Vec3::Zero();
    for (int64_t k = around.first[vertex]; k < around.first[vertex + 1]; ++k) {
      const int64_t face = around.corner[k] / 3;
      if (own.dot(unit.row(face)) >= threshold) sum += area.row(face);
    }
    const double length = sum.stableNorm();
    normals.row(i) = length > 0 ? Vec3(sum / length) : own;
  }
  return normals;
}

}  // namespace deform
