#include "core/files/polygons.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/error.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Positions Plane(const std::vector<Eigen::Vector2d>& points) {
  Positions positions = Positions::Zero(points.size(), 3);
  for (size_t i = 0; i < points.size(); ++i) {
    positions.row(i).head<2>() = points[i];
  }
  return positions;
}

Polygons OnePolygon(const Positions& positions) {
  Polygons polygons;
  for (int32_t i = 0; i < positions.rows(); ++i) polygons.corners.push_back(i);
  polygons.sizes = {static_cast<int32_t>(positions.rows())};
  return polygons;
}

std::vector<int32_t> TrianglesOf(const Positions& positions) {
  const Faces faces = *Triangulate(OnePolygon(positions), positions);
  return {faces.data(), faces.data() + faces.size()};
}

double Area(const Positions& p, const Faces& faces) {
  double sum = 0;
  for (const auto& face : faces.rowwise()) {
    const Vec3 a = p.row(face[1]) - p.row(face[0]);
    const Vec3 b = p.row(face[2]) - p.row(face[0]);
    const double twice = a.cross(b).z();
    EXPECT_GT(twice, 0) << "a triangle is flipped";
    sum += twice / 2;
  }
  return sum;
}

TEST(Triangulate, CutsASquareFromItsFirstCorner) {
  EXPECT_THAT(TrianglesOf(Plane({{0, 0}, {1, 0}, {1, 1}, {0, 1}})),
              ElementsAre(0, 1, 2, 0, 2, 3));
}

TEST(Triangulate, CutsAQuadAlongItsShorterDiagonal) {
  EXPECT_THAT(TrianglesOf(Plane({{0, 0}, {1, -0.1}, {3, 3}, {-0.1, 1}})),
              ElementsAre(0, 1, 3, 1, 2, 3));
}

TEST(Triangulate, NeverFlipsATriangleOfAConcaveQuad) {
  // The shorter diagonal, 1-3, lies outside.
  EXPECT_THAT(TrianglesOf(Plane({{0, 0}, {1, -1}, {0.9, 0}, {1, 1}})),
              ElementsAre(0, 1, 2, 0, 2, 3));
  EXPECT_THAT(TrianglesOf(Plane({{1, 1}, {0, 0}, {1, -1}, {0.9, 0}})),
              ElementsAre(0, 1, 3, 1, 2, 3));
}

TEST(Triangulate, ClipsEarsOfAConcavePolygonInAnyPlane) {
  std::vector<Eigen::Vector2d> star;
  for (int i = 0; i < 14; ++i) {
    const double radius = i % 2 == 0 ? 1 : 0.3;
    const double angle = std::numbers::pi * i / 7;
    star.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  const Positions flat = Plane(star);
  const double expected = 7 * 0.3 * std::sin(std::numbers::pi / 7);
  for (const Vec3& axis : {Vec3(0, 0, 1), Vec3(1, 0, 0), Vec3(1, 2, -1)}) {
    for (const double angle : {0.0, 2.0, 3.1}) {
      const Eigen::Matrix3d rotation =
          Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
      const Positions positions = flat * rotation.transpose();
      const Faces faces = *Triangulate(OnePolygon(positions), positions);
      ASSERT_EQ(faces.rows(), 12);
      EXPECT_NEAR(Area(flat, faces), expected, 1e-12);
    }
  }
}

TEST(Triangulate, GivesAlwaysTwoTrianglesLessThanCorners) {
  // Crossing itself, and without any area.
  EXPECT_EQ(TrianglesOf(Plane({{0, 0}, {1, 1}, {1, 0}, {0, 1}, {2, 2}})).size(),
            9);
  EXPECT_EQ(TrianglesOf(Positions::Zero(6, 3)).size(), 12);
}

TEST(Triangulate, KeepsPolygonsInTheirOrder) {
  const Positions p = Plane({{0, 0}, {1, 0}, {1, 1}, {0, 1}});
  const Polygons polygons{{0, 1, 2, 0, 1, 2, 3, 2, 3, 0}, {3, 4, 3}};
  const Faces faces = *Triangulate(polygons, p);
  Faces expected(4, 3);
  expected << 0, 1, 2, 0, 1, 2, 0, 2, 3, 2, 3, 0;
  EXPECT_EQ(faces, expected);
}

TEST(Triangulate, RefusesPolygonsBeyondItsBound) {
  const Positions p = Positions::Zero(kMaxPolygonCorners + 1, 3);
  const auto faces = Triangulate(OnePolygon(p), p);
  EXPECT_EQ(DetailOf(faces.status()).reason, "BAD_MESH_FILE");
  EXPECT_THAT(std::string(faces.status().message()),
              HasSubstr("polygon 0 has 1001 corners; at most 1000"));
}

}  // namespace
}  // namespace deform
