// Celestial weights of points on the hull of their handles.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "tests/core/weights/celestial_cases.h"

namespace deform {
namespace {

class CelestialOnTheHull : public testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(, CelestialOnTheHull, testing::Values("t_cc", "s_cc"));

TEST_P(CelestialOnTheHull, OnlyTheFaceCounts) {
  const TurnedCube cube;
  const Positions handles = cube.handles();
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> uniform(-0.95, 0.95);
  Positions points(200, 3);
  Positions flat(200, 3);
  for (int64_t i = 0; i < points.rows(); ++i) {
    flat.row(i) << uniform(random), uniform(random), 0;
    points.row(i) = cube.At(1, flat(i, 0), flat(i, 1)).transpose();
  }
  // The same scheme in the plane of the face.
  Positions square(4, 3);
  square << -1, -1, 0, -1, 1, 0, 1, -1, 0, 1, 1, 0;
  const WeightBlock expected = Weights(GetParam(), square, flat, {}, 2);
  const WeightBlock block = Weights(GetParam(), handles, points);
  for (int64_t i = 0; i < points.rows(); ++i) {
    ASSERT_NE(block.states[i], PointState::kOutsideHull) << i;
    ASSERT_NE(block.states[i], PointState::kNotConverged) << i;
    for (int64_t k = 0; k < 8; ++k) {
      const Eigen::RowVector3d corner = CubeCorners().row(k);
      double weight = 0;
      for (int64_t c = 0; c < 4; ++c) {
        if (corner.x() > 0 && square(c, 0) == corner.y() &&
            square(c, 1) == corner.z()) {
          weight = expected.vertex(i, c);
        }
      }
      // Rounded coordinates may lie 1e-15 inside, and S-CC goes like the root.
      EXPECT_NEAR(block.vertex(i, k), weight, 1e-6) << i;
    }
  }
}

TEST_P(CelestialOnTheHull, OnAnEdgeOnlyItsEndsCount) {
  const TurnedCube cube;
  for (const double t : {-0.9, -0.3, 0.0, 0.6}) {
    const WeightBlock block =
        Weights(GetParam(), cube.handles(), cube.At(1, t, -1).transpose());
    ASSERT_NE(block.states[0], PointState::kOutsideHull) << t;
    const Positions handles = cube.handles();
    for (int64_t k = 0; k < handles.rows(); ++k) {
      const double reach =
          (handles.row(k) - cube.At(1, t, -1).transpose()).norm();
      const bool below =
          (handles.row(k) - cube.At(1, -1, -1).transpose()).norm() < 1e-9;
      const bool above =
          (handles.row(k) - cube.At(1, 1, -1).transpose()).norm() < 1e-9;
      const double expected = below || above ? 1 - reach / 2 : 0;
      EXPECT_NEAR(block.vertex(0, k), expected, 1e-6) << t;
    }
  }
}

TEST_P(CelestialOnTheHull, AnExactPlaceIsToldAsBoundary) {
  const WeightBlock block =
      Weights(GetParam(), CubeCorners(), OnePoint(1, 0.25, -0.5));
  EXPECT_EQ(block.states[0], PointState::kBoundary);
  EXPECT_LT((block.vertex * CubeCorners() - OnePoint(1, 0.25, -0.5)).norm(),
            1e-15);
}

TEST(TranslationOnTheHull, UserWeightsOnTheFaceCountAndOthersRuleItOut) {
  const Positions corners = CubeCorners();
  SchemeOptions on_face;
  SchemeOptions off_face;
  for (int64_t k = 0; k < 8; ++k) {
    on_face.handle_weights.push_back(corners(k, 0) > 0 ? 1.0 + k : 0);
    off_face.handle_weights.push_back(corners(k, 0) < 0 ? 0.1 : 0);
  }
  const Positions point = OnePoint(1, 0.25, -0.5);
  const WeightBlock bound = Weights("t_cc", corners, point, on_face);
  EXPECT_EQ(bound.states[0], PointState::kBoundary);
  EXPECT_LT((bound.vertex * corners - point).norm(), 1e-15);
  const WeightBlock plain = Weights("t_cc", corners, point);
  EXPECT_GT((bound.vertex - plain.vertex).norm(), 0.01);
  const WeightBlock refused = Weights("t_cc", corners, point, off_face);
  EXPECT_EQ(refused.states[0], PointState::kOutsideHull);
  EXPECT_EQ(refused.vertex.cwiseAbs().maxCoeff(), 0);
}

}  // namespace
}  // namespace deform
