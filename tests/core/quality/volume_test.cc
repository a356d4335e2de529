#include "core/quality/volume.h"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/shapes.h"

namespace deform {
namespace {

double VolumeOf(const Shape& shape) {
  return VolumeOf(VolumeKindOf(shape.faces, 3), shape.positions, shape.faces);
}

TEST(Volume, OfAClosedMeshIsWhatItEncloses) {
  const Shape box = Cuboid({-1, -2, -3}, {1, 2, 3});
  EXPECT_EQ(VolumeKindOf(box.faces, 3), VolumeKind::kClosed);
  EXPECT_NEAR(VolumeOf(box), 48, 1e-13);
  EXPECT_NEAR(VolumeOf(Turned(box)), -48, 1e-13);
  EXPECT_NEAR(VolumeOf(Scaled(box, 1, {1e8, 0, 0})), 48, 1e-5);
}

TEST(Volume, OfSeveralPartsIsTheirSum) {
  const Shape two =
      Joined(Cuboid({0, 0, 0}, {1, 1, 1}), Cuboid({2, 0, 0}, {3, 1, 2}));
  EXPECT_EQ(VolumeKindOf(two.faces, 3), VolumeKind::kClosed);
  EXPECT_NEAR(VolumeOf(two), 3, 1e-14);
}

TEST(Volume, OfATubeIsThatWithItsEndsCapped) {
  const int around = 12;
  Shape tube = Tube(1, 5, around, 3);
  EXPECT_EQ(VolumeKindOf(tube.faces, 3), VolumeKind::kCapped);
  const double ring = 0.5 * around * std::sin(2 * std::numbers::pi / around);
  EXPECT_NEAR(std::abs(VolumeOf(tube)), 5 * ring, 1e-13);
  // The same somewhere else: caps belong to their rims.
  EXPECT_NEAR(std::abs(VolumeOf(Scaled(tube, 1, {100, 200, 300}))), 5 * ring,
              1e-10);
}

TEST(Volume, IsNotMadeUpWhereThereIsNone) {
  EXPECT_EQ(VolumeKindOf(Faces(0, 3), 3), VolumeKind::kNone);
  Shape box = Cuboid({0, 0, 0}, {1, 1, 1});
  box.faces.row(3).reverseInPlace();  // Disagrees with its neighbours.
  EXPECT_EQ(VolumeKindOf(box.faces, 3), VolumeKind::kNone);
  EXPECT_EQ(VolumeOf(box), 0);
}

TEST(Volume, IsTheAreaIn2D) {
  const Shape grid = Grid2d(5);
  EXPECT_EQ(VolumeKindOf(grid.faces, 2), VolumeKind::kArea);
  EXPECT_NEAR(VolumeOf(VolumeKind::kArea, 3 * grid.positions, grid.faces), 9,
              1e-14);
}

}  // namespace
}  // namespace deform
