#include "client/pictures/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace deform {
namespace {

using testing::HasSubstr;

Positions RandomPoints(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Positions points(count, 3);
  for (int i = 0; i < points.size(); ++i) points.data()[i] = uniform(random);
  return points;
}

TEST(Camera, SeesEveryPointFromEverywhere) {
  Positions points = RandomPoints(50, 1);
  points.col(0) *= 7;
  points.rowwise() += Eigen::RowVector3d(1000, -50, 3);
  for (const char* text :
       {"auto", "front", "top", "left", "bottom", "33,-61"}) {
    for (const View::Up up : {View::Up::kX, View::Up::kY, View::Up::kZ}) {
      const View view = ParseView(text, up).value();
      const Camera camera = Camera::Fit({points}, view, 300, 200, 0.05);
      double widest = 0;
      for (int i = 0; i < points.rows(); ++i) {
        const Projected at = camera.Project(points.row(i));
        EXPECT_GE(at.x, 0) << text;
        EXPECT_LE(at.x, 300) << text;
        EXPECT_GE(at.y, 0) << text;
        EXPECT_LE(at.y, 200) << text;
        EXPECT_GT(at.depth, 0) << text;
        widest = std::max(
            {widest, std::abs(at.x - 150) / 150, std::abs(at.y - 100) / 100});
      }
      EXPECT_GT(widest, 0.7) << text << ": the frame is not used";
    }
  }
}

TEST(Camera, TheFrontViewHasItsAxesWhereTheyBelong) {
  Positions points(4, 3);
  points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  const Camera camera = Camera::Fit(
      {points}, ParseView("front", View::Up::kZ).value(), 200, 200, 0.1);
  const Projected origin = camera.Project(points.row(0));
  EXPECT_GT(camera.Project(points.row(1)).x, origin.x) << "x points right";
  EXPECT_LT(camera.Project(points.row(3)).y, origin.y) << "z points up";
  EXPECT_GT(camera.Project(points.row(2)).depth, origin.depth)
      << "y points away";
}

TEST(Camera, AFlatViewKeepsProportions) {
  Positions points(3, 3);
  points << 0, 0, 0, 2, 0, 0, 0, 1, 0;
  const Camera camera = Camera::Flat({points}, 400, 400, 0.1);
  const Projected origin = camera.Project(points.row(0));
  const double right = camera.Project(points.row(1)).x - origin.x;
  const double up = origin.y - camera.Project(points.row(2)).y;
  EXPECT_NEAR(right, 2 * up, 1e-9);
}

TEST(Camera, OnePointIsEnough) {
  const Positions point = Positions::Zero(1, 3);
  EXPECT_NEAR(Camera::Fit({point}, {}, 100, 100, 0.1).Project(Vec3::Zero()).x,
              50, 1e-9);
  EXPECT_NEAR(Camera::Flat({point}, 100, 100, 0.1).Project(Vec3::Zero()).y, 50,
              1e-9);
}

TEST(View, SaysWhichViewsThereAre) {
  for (const char* text :
       {"", "sideways", "10", "10,x", "10,91", "400,0", "nan,0", "1,2,3"}) {
    const absl::StatusOr<View> view = ParseView(text, View::Up::kY);
    ASSERT_FALSE(view.ok()) << text;
    EXPECT_THAT(std::string(view.status().message()),
                HasSubstr("is no view: auto, front, back"));
  }
}

}  // namespace
}  // namespace deform
