#include "client/shapes/shapes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "client/shapes/surfaces.h"
#include "core/base/error.h"
#include "core/mesh/cage.h"
#include "core/mesh/convex_hull.h"
#include "core/mesh/handles.h"

namespace deform {
namespace {

class EveryShape : public testing::TestWithParam<std::string> {
 protected:
  EveryShape() : shape_(GenerateShape(GetParam(), 2000).value()) {}
  const GeneratedShape shape_;
};

INSTANTIATE_TEST_SUITE_P(, EveryShape, testing::ValuesIn(ShapeNames()),
                         [](const auto& test) { return test.param; });

TEST_P(EveryShape, HasAboutAsManyPointsAsAskedFor) {
  for (const int64_t points : {200, 2000, 20000}) {
    const int64_t made =
        GenerateShape(GetParam(), points).value().positions.rows();
    EXPECT_GT(made, points / 2);
    EXPECT_LT(made, points * 2);
  }
}

// A surface that is right is right as a cage.
TEST_P(EveryShape, IsClosedAndOutwardIn3D) {
  if (shape_.dimension == 2) return;
  const auto cage = Cage::Create(3, shape_.positions, shape_.faces);
  EXPECT_TRUE(cage.ok()) << cage.status();
}

TEST_P(EveryShape, LiesWithinItsCage) {
  if (shape_.cage.rows() == 0) return;
  const auto cage =
      Cage::Create(shape_.dimension, shape_.cage, shape_.cage_faces);
  ASSERT_TRUE(cage.ok()) << cage.status();
  for (int64_t i = 0; i < shape_.positions.rows(); ++i) {
    // 2D models reach up to their cage.
    EXPECT_GT(WindingNumber(*cage, shape_.positions.row(i)), 0.2) << i;
  }
}

TEST_P(EveryShape, LiesWithinTheHullOfItsHandles) {
  ASSERT_TRUE(Handles::Create(shape_.dimension, shape_.handles).ok());
  for (const HullPlane& plane : HullPlanes(shape_.handles, shape_.dimension)) {
    for (int64_t i = 0; i < shape_.positions.rows(); ++i) {
      EXPECT_LE(plane.Height(shape_.positions.row(i)), 1e-12);
    }
  }
}

TEST(Shapes, OfBadSizeOrNameAreRefused) {
  const absl::Status name = GenerateShape("cube", 1000).status();
  EXPECT_EQ(DetailOf(name).reason, "UNKNOWN_SHAPE");
  EXPECT_EQ(name.message(),
            "there is no shape 'cube': organ, bar, torus, plate, angle");
  for (const int64_t points : {99, 1000001}) {
    EXPECT_EQ(DetailOf(GenerateShape("bar", points).status()).reason,
              "INVALID_OPTION");
  }
}

TEST(Surfaces, CountTheirPoints) {
  EXPECT_EQ(UnitSphere(1).positions.rows(), 12);
  EXPECT_EQ(UnitSphere(7).positions.rows(), 10 * 49 + 2);
  EXPECT_EQ(BoxSurface({0, 0, 0}, {1, 1, 1}, {2, 2, 2}).positions.rows(), 26);
  EXPECT_EQ(TorusSurface(2, 1, 8, 5).positions.rows(), 40);
}

}  // namespace
}  // namespace deform
