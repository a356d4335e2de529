// Both celestial schemes, T-CC with and without user weights and S-CC, by what
// they promise for any handles.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/base/error.h"
#include "core/weights/schemes/celestial_newton.h"
#include "tests/core/weights/celestial_cases.h"

namespace deform {
namespace {

using testing::Each;
using testing::HasSubstr;

class Celestial : public testing::TestWithParam<Variant> {
 protected:
  WeightBlock Of(const Positions& handles, const Positions& points,
                 int dimension = 3) const {
    return Weights(GetParam().id, handles, points,
                   GetParam().OptionsFor(handles.rows()), dimension);
  }
};

INSTANTIATE_TEST_SUITE_P(, Celestial,
                         testing::Values(Variant{"Translation", "t_cc"},
                                         Variant{"TranslationWithUserWeights",
                                                 "t_cc", true},
                                         Variant{"Scaling", "s_cc"}),
                         [](const auto& test) { return test.param.name; });

TEST_P(Celestial, WeightsArePositiveSumToOneAndReproduceThePoint) {
  std::mt19937_64 random(1);
  const Positions handles = RandomPositions(20, random);
  const Positions points = RandomInside(handles, 500, random);
  const WeightBlock block = Of(handles, points);
  EXPECT_THAT(block.states, Each(PointState::kInside));
  EXPECT_GT(block.vertex.minCoeff(), 0);
  const Eigen::VectorXd sums = block.vertex.rowwise().sum();
  // 20 roundings of numbers below 1.
  EXPECT_LT((sums.array() - 1).abs().maxCoeff(), 2e-15);
  EXPECT_LT((block.vertex * handles - points).cwiseAbs().maxCoeff(), 1e-14);
}

TEST_P(Celestial, FourHandlesGiveBarycentricCoordinates) {
  std::mt19937_64 random(2);
  const Positions handles = RandomPositions(4, random);
  const Positions points = RandomInside(handles, 100, random);
  const WeightBlock block = Of(handles, points);
  Eigen::Matrix4d corners;
  corners << handles.transpose(), Eigen::RowVector4d::Ones();
  for (int64_t i = 0; i < points.rows(); ++i) {
    const Eigen::Vector4d point(points(i, 0), points(i, 1), points(i, 2), 1);
    const Eigen::Vector4d expected = corners.inverse() * point;
    // The tetrahedron's condition is below 100.
    EXPECT_LT((block.vertex.row(i).transpose() - expected).norm(), 1e-12);
  }
}

TEST_P(Celestial, WeightsIgnoreSimilarities) {
  std::mt19937_64 random(3);
  const Positions handles = RandomPositions(15, random);
  const Positions points = RandomInside(handles, 200, random);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Vec3(3, -1, 2).normalized()).toRotationMatrix();
  const auto moved = [&](const Positions& p) -> Positions {
    return (40 * p * turn.transpose()).rowwise() + Eigen::RowVector3d(7, -3, 9);
  };
  const WeightBlock before = Of(handles, points);
  const WeightBlock after = Of(moved(handles), moved(points));
  // Moving rounds the coordinates by 1e-15 of a hull about 50 of that wide from
  // the nearest points.
  EXPECT_LT((before.vertex - after.vertex).cwiseAbs().maxCoeff(), 1e-11);
}

TEST_P(Celestial, AHandleHasItsOwnPlace) {
  std::mt19937_64 random(4);
  const Positions handles = RandomPositions(12, random);
  const WeightBlock block = Of(handles, handles);
  EXPECT_EQ(block.vertex, RowMatrix::Identity(12, 12));
  EXPECT_THAT(block.states, Each(PointState::kInside));
}

TEST_P(Celestial, NextToAHandleThatHandleHasNearlyAll) {
  Positions handles(9, 3);
  handles << CubeCorners(), 0.2, 0.1, -0.3;
  for (const double distance : {1e-3, 1e-8, 1e-14}) {
    const WeightBlock block = Of(handles, OnePoint(0.2, 0.1 + distance, -0.3));
    EXPECT_GT(block.vertex(0, 8), 1 - 20 * distance) << distance;
  }
}

TEST_P(Celestial, CoincidentHandlesShareEquallyAtTheirPlace) {
  Positions handles(11, 3);
  handles << CubeCorners(), 0.5, 0, 0, 0.5, 0, 0, 0.5, 0, 0;
  const WeightBlock block = Of(handles, OnePoint(0.5, 0, 0));
  EXPECT_EQ(block.vertex.row(0).tail(3).minCoeff(), 1.0 / 3);
  EXPECT_EQ(block.vertex.row(0).tail(3).maxCoeff(), 1.0 / 3);
  EXPECT_EQ(block.vertex.row(0).head(8).cwiseAbs().maxCoeff(), 0);
  const WeightBlock beside = Of(handles, OnePoint(0.3, 0.1, 0));
  EXPECT_THAT(beside.states, Each(PointState::kInside));
  EXPECT_LT((beside.vertex * handles - OnePoint(0.3, 0.1, 0)).norm(), 1e-15);
}

TEST_P(Celestial, WeightsAreSmooth) {
  // Central differences of two steps differ by a quarter of each other's error
  // if third derivatives exist and are tame; a kink would show as 0.1.
  std::mt19937_64 random(5);
  const Positions handles = RandomPositions(12, random);
  const Positions points = RandomInside(handles, 50, random);
  const Eigen::RowVector3d axis(0.6, -0.5, 0.3);
  const auto slope = [&](double h) -> RowMatrix {
    const Positions ahead = points.rowwise() + h * axis;
    const Positions behind = points.rowwise() - h * axis;
    return (Of(handles, ahead).vertex - Of(handles, behind).vertex) / (2 * h);
  };
  const RowMatrix coarse = slope(2e-5);
  const RowMatrix fine = slope(1e-5);
  EXPECT_LT((coarse - fine).cwiseAbs().maxCoeff(),
            1e-5 * coarse.cwiseAbs().maxCoeff());
}

TEST_P(Celestial, TheStartDoesNotShow) {
  std::mt19937_64 random(6);
  const Positions handles = RandomPositions(30, random);
  const Positions points = RandomInside(handles, 300, random);
  const WeightBlock together = Of(handles, points);
  for (int64_t i = 0; i < points.rows(); ++i) {
    const WeightBlock alone = Of(handles, points.row(i));
    // Two searches that both end at the rounding floor.
    EXPECT_LT((alone.vertex.row(0) - together.vertex.row(i)).norm(), 1e-12);
  }
}

TEST_P(Celestial, WorksInThePlane) {
  std::mt19937_64 random(7);
  Positions handles = RandomPositions(9, random);
  handles.col(2).setZero();
  const Positions points = RandomInside(handles, 200, random);
  const WeightBlock block = Of(handles, points, 2);
  EXPECT_THAT(block.states, Each(PointState::kInside));
  EXPECT_GT(block.vertex.minCoeff(), 0);
  EXPECT_LT((block.vertex * handles - points).cwiseAbs().maxCoeff(), 1e-14);
}

TEST_P(Celestial, PointsOutsideTheHullAreToldAndGetNoWeights) {
  Positions points(6, 3);
  points << 1e6, 0, 0,  //
      1.5, 0.2, 0.1,    //
      1, 2, 0,          // In the plane of a face,
      1, 1, 3,          // on the line of an edge,
      1 + 1e-9, 0.3, 0.2, -1 - 1e-13, -1 - 1e-13, 0.4;
  const WeightBlock block = Of(CubeCorners(), points);
  EXPECT_THAT(block.states, Each(PointState::kOutsideHull));
  EXPECT_EQ(block.vertex.cwiseAbs().maxCoeff(), 0);
}

TEST(Scaling, LambdaDoesNotChangeWeights) {
  std::mt19937_64 random(9);
  const Positions handles = RandomPositions(20, random);
  const Positions points = RandomInside(handles, 100, random);
  const RowMatrix expected = Weights("s_cc", handles, points).vertex;
  for (const double lambda : {1.01, 1.5, 2.0, 10.0, 1e6}) {
    EXPECT_EQ(Weights("s_cc", handles, points, {.lambda = lambda}).vertex,
              expected)
        << lambda;
  }
}

// The paper's own equation: mu_i = q_i.c + sqrt((q_i.c)^2 + lambda^2 +
// 2 lambda |c|) with sum mu_i^2 q_i = 0. For every lambda there is a c that
// solves it, and the weights are the same: this is why lambda may be ignored.
TEST(Scaling, WeightsSolveThePapersEquationForEveryLambda) {
  std::mt19937_64 random(10);
  const Positions handles = RandomPositions(10, random);
  const Positions points = RandomInside(handles, 20, random);
  const WeightBlock block = Weights("s_cc", handles, points);
  for (int64_t i = 0; i < points.rows(); ++i) {
    Directions q;
    q.Resize(handles.rows());
    for (int64_t k = 0; k < handles.rows(); ++k) {
      q.Set(k, (handles.row(k) - points.row(i)).transpose());
    }
    const Vec3 y =
        Minimize(q, AsinhPotential(), WideVec3::Zero()).y.cast<double>();
    for (const double lambda : {1.01, 3.0, 50.0}) {
      const Vec3 c = lambda * (y.norm() + std::sqrt(y.squaredNorm() + 1)) * y;
      Eigen::VectorXd alpha(handles.rows());
      Vec3 sum = Vec3::Zero();
      double total = 0;
      for (int64_t k = 0; k < handles.rows(); ++k) {
        const double x = q.q(k).dot(c);
        const double mu =
            x + std::sqrt(x * x + lambda * lambda + 2 * lambda * c.norm());
        sum += mu * mu * q.q(k);
        total += mu * mu;
        alpha[k] = mu * mu / q.distance[k];
      }
      EXPECT_LT(sum.norm() / total, 1e-13) << lambda;
      alpha /= alpha.sum();
      EXPECT_LT((alpha - block.vertex.row(i).transpose()).norm(), 1e-12);
    }
  }
}

struct BadOption {
  std::string name;
  std::string id;
  SchemeOptions options;
  std::string message;
};

void PrintTo(const BadOption& bad, std::ostream* out) { *out << bad.name; }

class CelestialRefuses : public testing::TestWithParam<BadOption> {};

TEST_P(CelestialRefuses, AndSaysWhatToMend) {
  const absl::Status status =
      FindScheme(GetParam().id)
          .value()
          ->Prepare(HandlesOf(CubeCorners()), GetParam().options)
          .status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, "INVALID_OPTION");
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
}

SchemeOptions WithThird(double weight) {
  return {.handle_weights = {0, 1, 2, weight, 4, 5, 6, 7}};
}

INSTANTIATE_TEST_SUITE_P(
    , CelestialRefuses,
    testing::ValuesIn<BadOption>({
        {"TooFewWeights",
         "t_cc",
         {.handle_weights = {1, 1}},
         "there are 2 handle weights for 8 handles"},
        {"ANegativeWeight", "t_cc", WithThird(-1),
         "handle weight 3 is -1; it must be at least 0"},
        {"AWeightThatIsNoNumber", "t_cc", WithThird(std::nan("")),
         "handle weight 3 is nan; it must be at least 0"},
        {"AnInfiniteWeight", "t_cc", WithThird(HUGE_VAL),
         "handle weight 3 is inf; it must be at most 1e+12"},
        {"LambdaOfTheOtherScheme",
         "t_cc",
         {.lambda = 2},
         "scheme t_cc has no lambda"},
        {"WeightsOfTheOtherScheme", "s_cc", WithThird(1),
         "scheme s_cc has no handle weights"},
        {"LambdaOne", "s_cc", {.lambda = 1}, "lambda is 1; it must be above 1"},
        {"ANegativeLambda", "s_cc", {.lambda = -2}, "lambda is -2"},
        {"LambdaThatIsNoNumber",
         "s_cc",
         {.lambda = std::nan("")},
         "lambda is nan"},
        {"AnInfiniteLambda", "s_cc", {.lambda = HUGE_VAL}, "lambda is inf"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(CelestialSchemes, NeedHandles) {
  for (const char* id : {"t_cc", "s_cc"}) {
    const absl::Status status =
        FindScheme(id)
            .value()
            ->Prepare(CageOf(Cuboid({0, 0, 0}, {1, 1, 1})), {})
            .status();
    EXPECT_EQ(DetailOf(status).reason, "WRONG_RIG");
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("needs handles, but the rig is a cage"));
  }
}

}  // namespace
}  // namespace deform
