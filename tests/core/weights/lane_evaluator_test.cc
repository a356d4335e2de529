// The lanes of the closed forms, judged by the plain way on every instruction
// set.
#include "core/weights/schemes/lane_evaluator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/aligned_array.h"
#include "core/mesh/rig.h"
#include "core/weights/cage_faces.h"
#include "core/weights/schemes/green.h"
#include "core/weights/schemes/mean_value.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

struct Case {
  std::string name;
  int64_t target;  // Of Highway.
  int dimension;
  std::unique_ptr<const LaneEvaluator> (*make)(const Cage&, Way);
  // Whether weights of outside points come out of differences.
  bool sums_outside = false;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

std::vector<Case> Cases() {
  std::vector<Case> cases;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const std::string name = hwy::TargetName(target);
    cases.push_back({"Green2dOn" + name, target, 2, MakeGreenEvaluator});
    cases.push_back({"Green3dOn" + name, target, 3, MakeGreenEvaluator});
    cases.push_back(
        {"MeanValue2dOn" + name, target, 2, MakeMeanValueEvaluator, true});
    cases.push_back(
        {"MeanValue3dOn" + name, target, 3, MakeMeanValueEvaluator, true});
  }
  return cases;
}

class LanesOf : public testing::TestWithParam<Case> {
 protected:
  LanesOf() : set_(GetParam().target), random_(5) {}

  int dimension() const { return GetParam().dimension; }

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  // How many of `points` lanes solve to numbers of type T without help.
  template <typename T>
  int64_t Solved(const Cage& cage, const Positions& points) const {
    const auto lanes = Make(cage, Way::kLanes);
    const AlignedArray<char> scratch(lanes->ScratchBytes());
    const AlignedArray<T> weights((cage.vertex_count() + cage.face_count()) *
                                  kTilePoints);
    int64_t solved = 0;
    for (int64_t first = 0; first < points.rows(); first += kTilePoints) {
      LanePoints lane_points = lanes->PointsAt(points, first);
      lanes->EvaluateLanes(lane_points, scratch.get(), weights.get());
      const uint32_t present = (uint32_t{1} << lane_points.count) - 1;
      solved += std::popcount(lane_points.solved & present);
    }
    return solved;
  }

  // Not convex, without symmetries.
  Shape Blob() const {
    Shape shape = dimension() == 3 ? Icosphere(1, 1) : RegularLoop2d(1, 23);
    for (int64_t i = 0; i < shape.positions.rows(); ++i) {
      shape.positions.row(i) *= 1 + 0.2 * std::sin(2.9 * i);
    }
    return shape;
  }

  Positions RandomPoints(int64_t count, double reach) {
    Positions points = Positions::Zero(count, 3);
    for (int64_t i = 0; i < count; ++i) {
      for (int d = 0; d < dimension(); ++d) {
        points(i, d) = Uniform(-reach, reach);
      }
    }
    return points;
  }

  // `distance` from faces, edges and corners in turn.
  Positions PointsNear(const Cage& cage, int64_t count, double distance) {
    const CageFaces faces(cage);
    Positions points = Positions::Zero(count, 3);
    for (int64_t i = 0; i < count; ++i) {
      const CageFaces::Face& face = faces[i % faces.size()];
      Vec3 lambda(Uniform(0.2, 1), i % 3 == 2 ? 0 : Uniform(0.2, 1),
                  i % 3 == 0 && dimension() == 3 ? Uniform(0.2, 1) : 0);
      lambda /= lambda.sum();
      Vec3 at = Vec3::Zero(), away = Vec3::Zero();
      for (int k = 0; k < dimension(); ++k) {
        at += lambda[k] * face.position[k];
        away[k] = Uniform(-1, 1);
      }
      points.row(i) = at + distance * away.normalized();
    }
    return points;
  }

  std::unique_ptr<const LaneEvaluator> Make(const Cage& cage, Way way) const {
    return GetParam().make(cage, way);
  }

  void ExpectAsPlain(const Cage& cage, const Positions& points,
                     double in_double = 1e-12) const {
    WeightBlock plain, fast;
    Make(cage, Way::kPlain)->Evaluate(points, plain);
    const auto lanes = Make(cage, Way::kLanes);
    lanes->Evaluate(points, fast);
    EXPECT_EQ(fast.states, plain.states);
    const double scale = DiagonalOf(cage);
    // Of normals in model units far below 1.
    const double underflow = std::numeric_limits<float>::min() / scale;
    const int64_t vertices = plain.vertex.cols();
    WeightTiles tiles(points.rows(), vertices + plain.normal.cols());
    TileBlock block{.tiles = tiles.tile(0)};
    lanes->EvaluateTiles(points, block);
    EXPECT_EQ(block.states, plain.states);
    for (int64_t i = 0; i < points.rows(); ++i) {
      // Far away weights grow, and so does what they lose; in the plane psi has
      // a logarithm of a length in it.
      const double unit =
          std::max({1.0, dimension() == 2 ? std::abs(std::log(scale)) : 0,
                    plain.vertex.row(i).cwiseAbs().maxCoeff()});
      double worst = 0, worst_tile = 0;
      for (int64_t c = 0; c < tiles.columns(); ++c) {
        const bool vertex = c < vertices;
        const double expected =
            vertex ? plain.vertex(i, c) : plain.normal(i, c - vertices) / scale;
        const double actual =
            vertex ? fast.vertex(i, c) : fast.normal(i, c - vertices) / scale;
        const double tile = vertex ? tiles.at(i, c) : tiles.at(i, c) / scale;
        // Not a number is never within.
        worst = std::max(std::abs(actual - expected), worst);
        worst_tile = std::max(std::abs(tile - expected), worst_tile);
        ASSERT_FALSE(std::isnan(actual) || std::isnan(tile));
      }
      ASSERT_LE(worst, in_double * unit) << i << ": " << points.row(i);
      ASSERT_LE(worst_tile, (1e-6 + in_double) * unit + underflow)
          << i << ": " << points.row(i);
    }
  }

 private:
  OnInstructionSet set_;
  std::mt19937 random_;
};

INSTANTIATE_TEST_SUITE_P(, LanesOf, testing::ValuesIn(Cases()),
                         [](const auto& test) { return test.param.name; });

TEST_P(LanesOf, AgreeWithThePlainWayForAnyNumberOfPoints) {
  const Cage cage = CageOf(Blob());
  for (const int n : {0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 33, 100}) {
    ExpectAsPlain(cage, RandomPoints(n, 1.5));
  }
}

TEST_P(LanesOf, SolveNearlyAllPointsOfAModelThemselves) {
  const Cage cage = CageOf(Blob());
  const Positions points = RandomPoints(500, 0.55);
  EXPECT_GE(Solved<double>(cage, points), 495);
  EXPECT_GE(Solved<float>(cage, points), 495);
}

TEST_P(LanesOf, AgreeThroughoutTheCageAndAround) {
  ExpectAsPlain(CageOf(Blob()), RandomPoints(500, 1.5));
}

TEST_P(LanesOf, AgreeAtEveryDistanceFromFacesEdgesAndCorners) {
  const Cage cage = CageOf(Blob());
  for (int k = 1; k <= 12; ++k) {
    SCOPED_TRACE(k);
    ExpectAsPlain(cage,
                  PointsNear(cage, 60, std::pow(10, -k) * DiagonalOf(cage)));
  }
  ExpectAsPlain(cage, cage.vertices());
}

TEST_P(LanesOf, AgreeFarAway) {
  const Cage cage = CageOf(Blob());
  for (const double distance : {10.0, 1e3, 1e5, 1e9}) {
    SCOPED_TRACE(distance);
    // Terms cancel more and more, in either way.
    ExpectAsPlain(cage, RandomPoints(40, distance),
                  1e-12 + (GetParam().sums_outside ? 1e-11 : 1e-15) * distance);
  }
}

TEST_P(LanesOf, AgreeAtEveryScale) {
  const Shape shape = Blob();
  const Positions points = RandomPoints(100, 1.3);
  for (const double scale : {1e-60, 1e-12, 1e-3, 1e3, 1e12, 1e25}) {
    SCOPED_TRACE(scale);
    Shape scaled = shape;
    scaled.positions *= scale;
    ExpectAsPlain(CageOf(scaled), scale * points);
  }
}

TEST_P(LanesOf, AgreeFarFromTheOrigin) {
  const Positions points = RandomPoints(200, 1.3);
  for (const double offset : {1e2, 1e4, 1e6, 1e8}) {
    SCOPED_TRACE(offset);
    Shape shape = Blob();
    shape.positions.leftCols(dimension()).array() += offset;
    Positions moved = points;
    moved.leftCols(dimension()).array() += offset;
    ExpectAsPlain(CageOf(shape), moved);
    const Cage cage = CageOf(shape);
    ExpectAsPlain(cage, PointsNear(cage, 100, 0));
  }
}

TEST_P(LanesOf, AgreeInFlatCagesOfThinFaces) {
  for (const double flat : {0.1, 1e-2, 1e-4}) {
    SCOPED_TRACE(flat);
    Shape shape = Blob();
    shape.positions.col(1) *= flat;
    const Cage cage = CageOf(shape);
    Positions points = RandomPoints(300, 1.3);
    points.col(1) *= flat;
    // Thin faces lose a factor of their aspect, in either way.
    ExpectAsPlain(cage, points, 1e-12 / flat);
    ExpectAsPlain(cage, PointsNear(cage, 60, 1e-3 * flat), 1e-12 / flat);
  }
}

}  // namespace
}  // namespace deform
