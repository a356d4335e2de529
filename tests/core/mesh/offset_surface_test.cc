#include "core/mesh/offset_surface.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "core/mesh/closedness.h"
#include "core/mesh/distance_grid.h"
#include "core/mesh/topology.h"
#include "core/mesh/triangle.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

DistanceGrid GridOf(const Shape& shape, double spacing, double padding) {
  return DistanceGrid(shape.positions, shape.faces, spacing, padding);
}

double BruteDistance(const Shape& shape, const Vec3& point) {
  double nearest = 1e300;
  for (const auto& face : shape.faces.rowwise()) {
    const Vec3 on_face = ClosestOnTriangle(point, shape.positions.row(face[0]),
                                           shape.positions.row(face[1]),
                                           shape.positions.row(face[2]));
    nearest = std::min(nearest, (on_face - point).norm());
  }
  return nearest;
}

TEST(ClosestOnTriangle, BeatsAnyOtherPointOfIt) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  const auto point = [&] {
    return Vec3(number(random), number(random), number(random));
  };
  for (int i = 0; i < 200; ++i) {
    const Vec3 a = point();
    const Vec3 b = point();
    // Also triangles without area.
    const Vec3 c = i % 3 == 0 ? Vec3(0.3 * a + 0.7 * b) : point();
    const Vec3 p = 2 * point();
    const double distance = (ClosestOnTriangle(p, a, b, c) - p).norm();
    for (int u = 0; u <= 20; ++u) {
      for (int v = 0; u + v <= 20; ++v) {
        const Vec3 other = a + (b - a) * u / 20 + (c - a) * v / 20;
        EXPECT_LE(distance, (other - p).norm() + 1e-12);
      }
    }
  }
}

TEST(DistanceGrid, HoldsTheDistancesOfItsNodes) {
  const Shape shape = Torus(2, 0.5, 24, 12);
  const DistanceGrid grid = GridOf(shape, 0.25, 1);
  for (int k = 0; k < grid.nodes()[2]; k += 3) {
    for (int j = 0; j < grid.nodes()[1]; j += 3) {
      for (int i = 0; i < grid.nodes()[0]; i += 3) {
        const Vec3 node = grid.PositionOf({i, j, k});
        const double distance = BruteDistance(shape, node);
        // Sweeping may miss the nearest triangle by one nearly as close.
        EXPECT_NEAR(grid.distance(grid.IndexOf({i, j, k})), distance, 0.01);
        EXPECT_NEAR(grid.At(node), distance, 0.01);
      }
    }
  }
}

TEST(DistanceGrid, InterpolatesBetweenNodesAndHoldsItsBorderBeyond) {
  const DistanceGrid grid = GridOf(Grid2d(1), 0.25, 1);
  EXPECT_NEAR(grid.At({0.4, 0.6, 0.63}), 0.63, 1e-12);
  const double top = grid.PositionOf(grid.nodes()).z() - grid.spacing();
  EXPECT_GE(top, 1);
  EXPECT_NEAR(grid.At({0.5, 0.5, 9}), top, 1e-12);
  EXPECT_NEAR(grid.At({0.5, 0.5, -9}), 1, 1e-12);
}

double Volume(const TriangleSurface& surface) {
  double sum = 0;
  for (const auto& face : surface.faces.rowwise()) {
    const Vec3 a = surface.positions.row(face[0]);
    const Vec3 b = surface.positions.row(face[1]);
    const Vec3 c = surface.positions.row(face[2]);
    sum += a.cross(b).dot(c) / 6;
  }
  return sum;
}

TEST(OffsetSurface, IsClosedAndOrientedAndAtItsDistance) {
  const TriangleSurface surface =
      OffsetSurface(GridOf(Icosphere(1, 3), 0.1, 0.5), 0.25);
  EXPECT_EQ(CheckClosed(surface.faces, surface.positions.rows(), ""),
            absl::OkStatus());
  // Within a tenth of the spacing where interpolation is linear; clamped to a
  // tenth of an edge from nodes.
  for (const auto& row : surface.positions.rowwise()) {
    EXPECT_NEAR(row.norm(), 1.25, 0.03);
  }
  const double ball = 4.0 / 3 * std::numbers::pi * std::pow(1.25, 3);
  EXPECT_NEAR(Volume(surface) / ball, 1, 0.02);
}

TEST(OffsetSurface, FillsHollows) {
  // 0.5 would leave an inner sphere of radius 0.5 if it were not filled.
  const TriangleSurface surface =
      OffsetSurface(GridOf(Icosphere(1, 3), 0.1, 1), 0.5);
  for (const auto& row : surface.positions.rowwise()) {
    EXPECT_GT(row.norm(), 1);
  }
}

bool Always(const Vec3&, const Vec3&, const Vec3&) { return true; }

TEST(Decimate, ReachesItsTargetAndStaysClosed) {
  const Shape torus = Torus(0.4, 0.1, 40, 20);
  const TriangleSurface coarse =
      Decimate({torus.positions, torus.faces}, 200, Always);
  EXPECT_EQ(coarse.faces.rows(), 200);
  EXPECT_EQ(coarse.positions.rows(), 100);
  EXPECT_EQ(CheckClosed(coarse.faces, coarse.positions.rows(), ""),
            absl::OkStatus());
  EXPECT_GT(Volume(coarse), 0.8 * Volume({torus.positions, torus.faces}));
}

TEST(Decimate, MakesNoTriangleThatIsNotAllowed) {
  const Shape sphere = Icosphere(0.5, 3);
  const auto none = [](const Vec3&, const Vec3&, const Vec3&) { return false; };
  EXPECT_EQ(Decimate({sphere.positions, sphere.faces}, 20, none).faces.rows(),
            sphere.faces.rows());
  const auto short_sides = [](const Vec3& a, const Vec3& b, const Vec3& c) {
    return (a - b).norm() < 0.3 && (b - c).norm() < 0.3 && (c - a).norm() < 0.3;
  };
  const TriangleSurface coarse =
      Decimate({sphere.positions, sphere.faces}, 20, short_sides);
  EXPECT_LT(coarse.faces.rows(), sphere.faces.rows());
  for (const auto& face : coarse.faces.rowwise()) {
    EXPECT_TRUE(short_sides(coarse.positions.row(face[0]),
                            coarse.positions.row(face[1]),
                            coarse.positions.row(face[2])));
  }
}

}  // namespace
}  // namespace deform
