#include "core/mesh/convex_hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/shapes.h"

namespace deform {
namespace {

double Depth(const std::vector<HullPlane>& planes, const Vec3& point) {
  double depth = 1e300;
  for (const HullPlane& plane : planes) {
    depth = std::min(depth, -plane.Height(point));
  }
  return depth;
}

Positions RandomPoints(int64_t count, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> coordinate(-1, 1);
  Positions points(count, 3);
  for (int64_t i = 0; i < points.size(); ++i) {
    points.data()[i] = coordinate(random);
  }
  return points;
}

TEST(HullPlanes, OfACubeAreItsSides) {
  const Positions cube = Cuboid({-1, -2, -3}, {1, 2, 3}).positions;
  const auto planes = HullPlanes(cube, 3);
  EXPECT_EQ(planes.size(), 12u);
  EXPECT_NEAR(Depth(planes, {0, 0, 0}), 1, 1e-15);
  EXPECT_NEAR(Depth(planes, {0.75, 0, 0}), 0.25, 1e-15);
  EXPECT_NEAR(Depth(planes, {0, 1.9, 0}), 0.1, 1e-15);
  EXPECT_NEAR(Depth(planes, {0, 0, 4}), -1, 1e-15);
}

// Hundreds of points on six planes and along twelve edges.
TEST(HullPlanes, TakeCoplanarAndCoincidentPoints) {
  const Positions bar =
      Bar({0, 0, 0}, {1, 1, 1}, std::array<int, 3>{7, 6, 5}).positions;
  Positions twice(2 * bar.rows(), 3);
  twice << bar, bar;
  const auto planes = HullPlanes(twice, 3);
  for (const double d : {0.5, 0.1, 1e-6}) {
    EXPECT_NEAR(Depth(planes, {d, 0.5, 0.4}), std::min(d, 0.4), 1e-12);
    EXPECT_NEAR(Depth(planes, {0.5, 0.5, 1 - d}), d, 1e-12);
  }
}

TEST(HullPlanes, HaveAllPointsOnTheirInnerSide) {
  for (const double offset : {0.0, 1e6}) {
    for (int64_t n : {4, 5, 30, 2000}) {
      Positions points = RandomPoints(n, n);
      points.array() += offset;
      const auto planes = HullPlanes(points, 3);
      ASSERT_GE(planes.size(), 4u);
      std::vector<int> corners(n, 0);
      for (const HullPlane& plane : planes) {
        for (int64_t i = 0; i < n; ++i) {
          const double height = plane.Height(points.row(i));
          EXPECT_LE(height, 2e-12 * 2 * std::sqrt(3));
          corners[i] += height > -1e-9;
        }
      }
      // In general position: Euler's formula.
      const auto on_hull = n - std::count(corners.begin(), corners.end(), 0);
      EXPECT_EQ(std::ssize(planes), 2 * on_hull - 4) << n;
    }
  }
}

TEST(HullPlanes, OfASphereAreAllItsTriangles) {
  const Shape sphere = Icosphere(2, 3);
  EXPECT_EQ(std::ssize(HullPlanes(sphere.positions, 3)), sphere.faces.rows());
}

TEST(HullPlanes, AreLinesIn2D) {
  Positions points = RandomPoints(500, 3);
  points.col(2).setZero();
  Positions square(504, 3);
  square << -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, points;
  const auto lines = HullPlanes(square, 2);
  EXPECT_EQ(lines.size(), 4u);
  EXPECT_NEAR(Depth(lines, {0.9, 0.2, 0}), 0.1, 1e-15);
  EXPECT_NEAR(Depth(lines, {0, 0, 0}), 1, 1e-15);
  EXPECT_NEAR(Depth(lines, {0, -2, 0}), -1, 1e-15);
}

}  // namespace
}  // namespace deform
