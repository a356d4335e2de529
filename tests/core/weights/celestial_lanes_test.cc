// The lane solver of every instruction set, judged by the plain one.
#include "core/weights/schemes/celestial_lanes.h"

#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  LaneSolver solver;
  CelestialKind kind;
  bool user_weights;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.solver.name; }

std::vector<Case> Cases() {
  std::vector<Case> cases;
  const LaneSolvers solvers = RunnableLaneSolvers();
  for (int k = 0; k < solvers.count; ++k) {
    cases.push_back({solvers.entries[k], CelestialKind::kScaling, false});
    cases.push_back({solvers.entries[k], CelestialKind::kTranslation, false});
    cases.push_back({solvers.entries[k], CelestialKind::kTranslation, true});
  }
  return cases;
}

class CelestialLanes : public testing::TestWithParam<Case> {
 protected:
  WeightBlock Of(const Positions& handles, const Positions& points,
                 std::optional<LaneSolver> lanes, int dimension = 3) const {
    std::vector<double> s;
    for (int64_t k = 0; GetParam().user_weights && k < handles.rows(); ++k) {
      s.push_back(0.3 * (k % 4));
    }
    WeightBlock block;
    MakeCelestialEvaluator(
        GetParam().kind, Handles::Create(dimension, handles).value(), s, lanes)
        ->Evaluate(points, block);
    return block;
  }

  void ExpectAsPlain(const Positions& handles, const Positions& points,
                     int dimension = 3) const {
    const WeightBlock fast = Of(handles, points, GetParam().solver, dimension);
    const WeightBlock plain = Of(handles, points, std::nullopt, dimension);
    EXPECT_EQ(fast.states, plain.states);
    ASSERT_EQ(fast.vertex.rows(), plain.vertex.rows());
    if (points.rows() == 0) return;
    // Both end at the rounding floor; inside a cube that is 1e-14.
    EXPECT_LT((fast.vertex - plain.vertex).cwiseAbs().maxCoeff(), 1e-12);
  }
};

INSTANTIATE_TEST_SUITE_P(, CelestialLanes, testing::ValuesIn(Cases()),
                         [](const auto& test) {
                           const Case& c = test.param;
                           return std::string(c.solver.name) +
                                  (c.kind == CelestialKind::kScaling ? "Scaling"
                                   : c.user_weights
                                       ? "TranslationWithUserWeights"
                                       : "Translation");
                         });

TEST_P(CelestialLanes, AgreeWithThePlainWayForAnyNumberOfPoints) {
  std::mt19937_64 random(1);
  const Positions handles = CubeWith(20, random);
  for (const int64_t n : {0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 100}) {
    ExpectAsPlain(handles, RandomPositions(n, 0.95, random));
  }
}

TEST_P(CelestialLanes, AgreeForAnyNumberOfHandles) {
  std::mt19937_64 random(2);
  for (const int64_t inner : {0, 1, 100, 3000}) {
    ExpectAsPlain(CubeWith(inner, random), RandomPositions(20, 0.9, random));
  }
}

TEST_P(CelestialLanes, LeaveOtherPointsToThePlainWay) {
  std::mt19937_64 random(3);
  const Positions handles = CubeWith(5, random);
  Positions points = RandomPositions(40, 1.5, random);
  points.row(3) = handles.row(9);
  points.row(17) << 1, 0.2, 0.3;
  points.row(18) << 1 - 1e-9, 0.2, 0.3;
  ExpectAsPlain(handles, points);
}

TEST_P(CelestialLanes, WorkInThePlane) {
  std::mt19937_64 random(4);
  Positions handles(9, 3);
  handles << -1, -1, 0, -1, 1, 0, 1, -1, 0, 1, 1, 0,
      RandomPositions(5, 1, random);
  handles.col(2).setZero();
  Positions points = RandomPositions(50, 0.9, random);
  points.col(2).setZero();
  ExpectAsPlain(handles, points, 2);
}

TEST_P(CelestialLanes, KeepTheirDigitsAtEveryScale) {
  std::mt19937_64 random(5);
  const Positions handles = CubeWith(10, random);
  const Positions points = RandomPositions(30, 0.9, random);
  for (const double scale : {1e-150, 1e-90, 1e-6, 1e6, 1e95}) {
    ExpectAsPlain(scale * handles, scale * points);
  }
}

TEST_P(CelestialLanes, SolveNearlyAllPointsOfAModelThemselves) {
  std::mt19937_64 random(6);
  const Positions handles = CubeWith(22, random);
  const LaneSolver& solver = GetParam().solver;
  constexpr int kHandles = 30;
  alignas(64) double scratch[8 * kHandles * kMaxLanes];
  alignas(64) double weights[kHandles * kMaxLanes];
  alignas(64) double points[3 * kMaxLanes];
  const Eigen::Matrix<double, Eigen::Dynamic, 3> columns = handles;
  const std::vector<double> s(kHandles, GetParam().user_weights ? 0.5 : 0);
  const bool scaling = GetParam().kind == CelestialKind::kScaling;
  int unsolved = 0;
  for (int group = 0; group < 1000 / solver.lanes; ++group) {
    const Positions places = RandomPositions(solver.lanes, 0.9, random);
    for (int d = 0; d < 3; ++d) {
      for (int lane = 0; lane < solver.lanes; ++lane) {
        points[d * solver.lanes + lane] = places(lane, d);
      }
    }
    alignas(64) double solution[3 * kMaxLanes] = {};
    LaneJob job = {.handles = kHandles,
                   .x = columns.col(0).data(),
                   .y = columns.col(1).data(),
                   .z = columns.col(2).data(),
                   .s = scaling ? nullptr : s.data(),
                   .points = points,
                   .scratch = scratch,
                   .weights = weights,
                   .solution = solution};
    solver.solve(job);
    for (int lane = 0; lane < solver.lanes; ++lane) {
      unsolved += !(job.solved >> lane & 1);
    }
  }
  // User weights now and then need a damped step, which lanes do not have.
  EXPECT_LE(unsolved, GetParam().user_weights ? 50 : 10);
}

}  // namespace
}  // namespace deform
