// The lane solver, judged by the plain one on every instruction set.
#include "core/weights/schemes/celestial_lanes.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "core/mesh/handles.h"
#include "core/weights/schemes/celestial_evaluator.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::Each;

Positions RandomPositions(int64_t n, double reach, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-reach, reach);
  Positions positions(n, 3);
  for (int64_t i = 0; i < n; ++i) {
    for (int d = 0; d < 3; ++d) positions(i, d) = uniform(random);
  }
  return positions;
}

// A cube's corners and `inner` handles within.
Positions CubeWith(int64_t inner, std::mt19937_64& random) {
  Positions handles(8 + inner, 3);
  handles << Cuboid({-1, -1, -1}, {1, 1, 1}).positions,
      RandomPositions(inner, 1, random);
  return handles;
}

struct Case {
  std::string name;
  int64_t target;  // Of Highway.
  CelestialKind kind;
  bool user_weights = false;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

std::vector<Case> Cases() {
  std::vector<Case> cases;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const std::string name = hwy::TargetName(target);
    cases.push_back({name + "Scaling", target, CelestialKind::kScaling});
    cases.push_back(
        {name + "Translation", target, CelestialKind::kTranslation});
    cases.push_back({name + "TranslationWithUserWeights", target,
                     CelestialKind::kTranslation, true});
  }
  return cases;
}

class CelestialLanesOn : public testing::TestWithParam<Case> {
 protected:
  CelestialLanesOn() { Choose(GetParam().target); }
  ~CelestialLanesOn() override { Choose(0); }  // The best again.

  static void Choose(int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }

  WeightBlock Of(const Positions& handles, const Positions& points,
                 CelestialWay way, int dimension) const {
    std::vector<double> s;
    for (int64_t k = 0; GetParam().user_weights && k < handles.rows(); ++k) {
      s.push_back(k == 0 ? 100 : 0.3 * (k % 4));
    }
    WeightBlock block;
    MakeCelestialEvaluator(GetParam().kind,
                           Handles::Create(dimension, handles).value(), s, way)
        ->Evaluate(points, block);
    return block;
  }

  void ExpectAsPlain(const Positions& handles, const Positions& points,
                     int dimension = 3) const {
    const WeightBlock fast =
        Of(handles, points, CelestialWay::kLanes, dimension);
    const WeightBlock plain =
        Of(handles, points, CelestialWay::kPlain, dimension);
    EXPECT_EQ(fast.states, plain.states);
    ASSERT_EQ(fast.vertex.rows(), plain.vertex.rows());
    if (points.rows() == 0) return;
    // Both end at the rounding floor; inside a cube that is 1e-14.
    EXPECT_LT((fast.vertex - plain.vertex).cwiseAbs().maxCoeff(), 1e-12);
    ASSERT_EQ(fast.residuals.size(), plain.residuals.size());
    for (size_t i = 0; i < plain.residuals.size(); ++i) {
      // What lanes call solved is below 1e-14; the rest is the plain way's.
      EXPECT_LE(fast.residuals[i], std::max(1e-14, plain.residuals[i]));
    }
  }
};

INSTANTIATE_TEST_SUITE_P(, CelestialLanesOn, testing::ValuesIn(Cases()),
                         [](const auto& test) { return test.param.name; });

TEST_P(CelestialLanesOn, AgreeWithThePlainWayForAnyNumberOfPoints) {
  std::mt19937_64 random(1);
  const Positions handles = CubeWith(20, random);
  for (const int64_t n : {0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 100}) {
    ExpectAsPlain(handles, RandomPositions(n, 0.95, random));
  }
}

TEST_P(CelestialLanesOn, AgreeForAnyNumberOfHandles) {
  std::mt19937_64 random(2);
  for (const int64_t inner : {0, 1, 100, 3000}) {
    ExpectAsPlain(CubeWith(inner, random), RandomPositions(20, 0.9, random));
  }
}

TEST_P(CelestialLanesOn, LeaveOtherPointsToThePlainWay) {
  std::mt19937_64 random(3);
  const Positions handles = CubeWith(5, random);
  Positions points = RandomPositions(40, 1.5, random);
  points.row(3) = handles.row(9);
  points.row(17) << 1, 0.2, 0.3;
  points.row(18) << 1 - 1e-9, 0.2, 0.3;
  ExpectAsPlain(handles, points);
}

TEST_P(CelestialLanesOn, KnowASymmetricOverflowFromASolution) {
  // The first steps of the heavy handle overshoot; around the middle of a cube
  // all that overflowed would balance.
  std::mt19937_64 random(7);
  Positions points = RandomPositions(16, 1e-3, random);
  points.row(0).setZero();
  ExpectAsPlain(CubeWith(0, random), points);
}

TEST_P(CelestialLanesOn, WorkInThePlane) {
  std::mt19937_64 random(4);
  Positions handles(9, 3);
  handles << -1, -1, 0, -1, 1, 0, 1, -1, 0, 1, 1, 0,
      RandomPositions(5, 1, random);
  handles.col(2).setZero();
  Positions points = RandomPositions(50, 0.9, random);
  points.col(2).setZero();
  ExpectAsPlain(handles, points, 2);
}

TEST_P(CelestialLanesOn, KeepTheirDigitsAtEveryScale) {
  std::mt19937_64 random(5);
  const Positions handles = CubeWith(10, random);
  const Positions points = RandomPositions(30, 0.9, random);
  for (const double scale : {1e-150, 1e-90, 1e-6, 1e6, 1e95}) {
    ExpectAsPlain(scale * handles, scale * points);
  }
}

TEST_P(CelestialLanesOn, SolveNearlyAllPointsOfAModelThemselves) {
  std::mt19937_64 random(6);
  const Positions handles = CubeWith(22, random);
  const int lanes = CelestialLanes();
  constexpr int kHandles = 30;
  alignas(64) double scratch[8 * kHandles * kMaxCelestialLanes];
  alignas(64) double weights[kHandles * kMaxCelestialLanes];
  alignas(64) double points[3 * kMaxCelestialLanes];
  const Eigen::Matrix<double, Eigen::Dynamic, 3> columns = handles;
  const std::vector<double> s(kHandles, GetParam().user_weights ? 0.5 : 0);
  const bool scaling = GetParam().kind == CelestialKind::kScaling;
  int unsolved = 0;
  for (int group = 0; group < 1000 / lanes; ++group) {
    const Positions places = RandomPositions(lanes, 0.9, random);
    for (int d = 0; d < 3; ++d) {
      for (int lane = 0; lane < lanes; ++lane) {
        points[d * lanes + lane] = places(lane, d);
      }
    }
    alignas(64) double solution[3 * kMaxCelestialLanes] = {};
    alignas(64) double residual[kMaxCelestialLanes];
    CelestialLaneJob job = {.handles = kHandles,
                            .x = columns.col(0).data(),
                            .y = columns.col(1).data(),
                            .z = columns.col(2).data(),
                            .s = scaling ? nullptr : s.data(),
                            .points = points,
                            .scratch = scratch,
                            .weights = weights,
                            .solution = solution,
                            .residual = residual};
    SolveCelestialLanes(job);
    for (int lane = 0; lane < lanes; ++lane) {
      unsolved += !(job.solved >> lane & 1);
    }
  }
  // User weights now and then need a damped step, which lanes do not have.
  EXPECT_LE(unsolved, GetParam().user_weights ? 50 : 10);
}

}  // namespace
}  // namespace deform
