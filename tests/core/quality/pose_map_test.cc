#include "core/quality/pose_map.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include <Eigen/Geometry>

#include "core/weights/scheme.h"
#include "tests/core/quality/posed.h"

namespace deform {
namespace {

std::vector<Derivative> DerivativesOf(
    const std::shared_ptr<const Binding>& binding, const Pose& pose) {
  std::vector<int64_t> all(binding->point_count());
  std::iota(all.begin(), all.end(), 0);
  return (*PoseMap::Create(*binding, pose))->Differentiate(all);
}

Pose AffinelyPosed(const Rig& rig, const Eigen::Matrix3d& linear,
                   const Vec3& offset) {
  Pose pose = RestPose(rig);
  pose.vertices =
      (pose.vertices * linear.transpose()).rowwise() + offset.transpose();
  return pose;
}

class PoseMapOf : public testing::TestWithParam<const CoordinateScheme*> {
 protected:
  static std::string scheme() { return std::string(GetParam()->id()); }
};

INSTANTIATE_TEST_SUITE_P(AllSchemes, PoseMapOf,
                         testing::ValuesIn(AllSchemes().begin(),
                                           AllSchemes().end()),
                         [](const auto& test) {
                           return std::string(test.param->id());
                         });

TEST_P(PoseMapOf, ARigidMotionIsItsRotation) {
  const auto binding = BindTo(
      scheme(), Icosphere(0.7, 2),
      RigFor(scheme(),
             Bar(Vec3::Constant(-1), Vec3::Constant(1), std::array{2, 2, 2})));
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(1.1, Vec3(1, 2, 3).normalized()).matrix();
  for (const Derivative& derivative : DerivativesOf(
           binding, AffinelyPosed(binding->rig(), 2 * rotation, {5, 6, 7}))) {
    ASSERT_EQ(derivative.measured, Measured::kYes);
    // The fit of the similarity; what it leaves is rounding.
    EXPECT_LT((derivative.jacobian - 2 * rotation).norm(), 1e-11);
  }
}

TEST_P(PoseMapOf, AnAffineMapIsReproducedWhereNormalsPlayNoPart) {
  if (GetParam()->uses_normals()) return;
  for (const int dimension : {2, 3}) {
    const Shape cage = dimension == 3 ? Icosphere(1, 1) : RegularLoop2d(1, 9);
    Shape model = dimension == 3 ? Icosphere(0.6, 2) : Grid2d(9);
    if (dimension == 2) model.positions.array().leftCols<2>() -= 0.4;
    const auto binding = BindTo(scheme(), model, RigFor(scheme(), cage));
    Eigen::Matrix3d shear = Eigen::Matrix3d::Identity();
    shear(0, 1) = 1.5;
    shear(1, 1) = 0.25;
    for (const Derivative& derivative : DerivativesOf(
             binding, AffinelyPosed(binding->rig(), shear, Vec3::Zero()))) {
      ASSERT_EQ(derivative.measured, Measured::kYes);
      Eigen::Matrix3d expected = shear;
      if (dimension == 2) expected(2, 2) = 0;
      // Differences of fourth order, see Differentiate(); weights of the
      // celestial schemes are solved to 1e-14.
      EXPECT_LT((derivative.jacobian - expected).norm(), 1e-9);
    }
  }
}

TEST_P(PoseMapOf, ARandomPoseAgreesWithCoarserDifferencesOfPositions) {
  const Shape cage =
      Bar(Vec3::Constant(-1), Vec3::Constant(1), std::array{2, 2, 2});
  // A point and its neighbours at distance h along the axes.
  constexpr double kStep = 1e-4;
  const Vec3 place(0.2, -0.3, 0.4);
  Shape model{Positions(7, 3), Faces(0, 3)};
  model.positions.row(0) = place.transpose();
  for (int d = 0; d < 3; ++d) {
    model.positions.row(1 + 2 * d) = place + kStep * Vec3::Unit(d);
    model.positions.row(2 + 2 * d) = place - kStep * Vec3::Unit(d);
  }
  const auto binding = BindTo(scheme(), model, RigFor(scheme(), cage));
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.2);
  Pose pose = RestPose(binding->rig());
  for (double& x : pose.vertices.reshaped()) x += noise(random);
  const PosedColumns posed(binding->rig(), GetParam()->uses_normals());
  Columns columns;
  posed.UpdateAll(pose, columns);
  const WeightBlock weights = *RecomputeWeights(*binding, 0, 7);
  Positions moved = weights.vertex * columns.topRows(weights.vertex.cols());
  if (weights.normal.cols() > 0) {
    moved += weights.normal * columns.bottomRows(weights.normal.cols());
  }
  Eigen::Matrix3d expected;
  for (int d = 0; d < 3; ++d) {
    expected.col(d) =
        (moved.row(1 + 2 * d) - moved.row(2 + 2 * d)).transpose() / (2 * kStep);
  }
  const Derivative found = DerivativesOf(binding, pose)[0];
  ASSERT_EQ(found.measured, Measured::kYes);
  // Second order: kStep^2 times a third derivative of about 10.
  EXPECT_LT((found.jacobian - expected).norm(), 3e-7);
}

TEST_P(PoseMapOf, PointsOnTheRigAreNotMeasured) {
  const Shape cage = Cuboid({-1, -1, -1}, {1, 1, 1});
  Shape model{Positions(5, 3), Faces(0, 3)};
  model.positions << 1, 0.2, 0.3,  // On a face,
      1, 1, 0,                     // an edge,
      -1, -1, -1,                  // a vertex,
      1 - 1e-8, 0, 0,              // and nearly on one.
      1 - 1e-5, 0.1, 0.2;
  const auto binding = BindTo(scheme(), model, RigFor(scheme(), cage));
  Pose pose = RestPose(binding->rig());
  pose.vertices(6, 0) += 0.5;
  const auto derivatives = DerivativesOf(binding, pose);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(derivatives[i].measured, Measured::kNearRig) << i;
  }
  ASSERT_EQ(derivatives[4].measured, Measured::kYes);
  EXPECT_TRUE(derivatives[4].jacobian.allFinite());
}

TEST(PoseMap, PassesPointsWithoutWeightsOver) {
  Shape model{Positions(2, 3), Faces(0, 3)};
  model.positions << 0, 0, 0, 3, 0, 0;
  const Shape cage = Cuboid({-1, -1, -1}, {1, 1, 1});
  for (const char* scheme : {"green", "s_cc"}) {
    const auto binding = BindTo(scheme, model, RigFor(scheme, cage));
    const auto derivatives = DerivativesOf(binding, RestPose(binding->rig()));
    EXPECT_EQ(derivatives[0].measured, Measured::kYes);
    EXPECT_EQ(derivatives[1].measured, Measured::kFixed);
  }
}

TEST(PoseMap, DoesNotMeasureAHandlesOwnPlace) {
  Shape cage = Cuboid({-1, -1, -1}, {1, 1, 1});
  Positions handles(9, 3);
  handles << cage.positions, 0.1, 0.2, 0.3;
  Shape model{Positions(2, 3), Faces(0, 3)};
  model.positions << 0.1, 0.2, 0.3, 0.1, 0.2, 0.31;
  const auto binding =
      BindTo("s_cc", model, Handles::Create(3, handles).value());
  const auto derivatives = DerivativesOf(binding, RestPose(binding->rig()));
  EXPECT_EQ(derivatives[0].measured, Measured::kNearRig);
  ASSERT_EQ(derivatives[1].measured, Measured::kYes);
  EXPECT_LT((derivatives[1].jacobian - Eigen::Matrix3d::Identity()).norm(),
            1e-14);
}

// In 2D the map is conformal, also where it is extended.
TEST(PoseMap, OfGreenIsConformalInThePlane) {
  Shape model = Grid2d(30);
  model.positions *= 3;
  model.positions.leftCols<2>().array() -= 1.52;  // Not on a vertex.
  const Shape loop = RegularLoop2d(1, 7);
  ExitRegions exits;
  exits.kind = ExitRegions::Kind::kAutomatic;
  model.faces.resize(0, 3);
  const auto binding = BindTo("green", model, CageOf(loop), exits);
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.3);
  Pose pose = RestPose(binding->rig());
  for (double& x : pose.vertices.leftCols<2>().reshaped()) x += noise(random);
  int outside = 0;
  const auto derivatives = DerivativesOf(binding, pose);
  for (size_t i = 0; i < derivatives.size(); ++i) {
    ASSERT_EQ(derivatives[i].measured, Measured::kYes);
    const Eigen::Matrix3d& j = derivatives[i].jacobian;
    EXPECT_NEAR(j(0, 0), j(1, 1), 1e-12);
    EXPECT_NEAR(j(0, 1), -j(1, 0), 1e-12);
    EXPECT_EQ(j(2, 2), 0);
    outside += model.positions.row(i).norm() > 1;
  }
  EXPECT_GT(outside, 300);
}

}  // namespace
}  // namespace deform
