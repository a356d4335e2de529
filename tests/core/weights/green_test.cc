// What is special about Green coordinates; what all schemes promise is in
// scheme_property_test.cc, reference values are in tests/golden.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "core/weights/cage_faces.h"
#include "core/weights/scheme.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

WeightBlock Evaluate(const Cage& cage, const Positions& points) {
  const auto evaluator = (*FindScheme("green"))->Prepare(cage, {});
  WeightBlock block;
  (*evaluator)->Evaluate(points, block);
  return block;
}

Positions OnePoint(double x, double y, double z) {
  Positions point(1, 3);
  point << x, y, z;
  return point;
}

// Coordinates are multiples of 1/64, so that sums with whole numbers are exact.
Shape Dyadic(Shape shape) {
  shape.positions = (shape.positions * 64).array().round() / 64;
  return shape;
}

Shape Blob(int dimension) {
  Shape shape = dimension == 3 ? Icosphere(1, 2) : RegularLoop2d(1, 13);
  for (int64_t i = 0; i < shape.positions.rows(); ++i) {
    shape.positions.row(i) *= 1 + 0.3 * std::sin(2.9 * i);
  }
  return Dyadic(shape);
}

Positions DyadicPoints(int count, int dimension) {
  std::mt19937 random(11);
  std::uniform_int_distribution<int> coordinate(-80, 80);
  Positions points = Positions::Zero(count, 3);
  for (int i = 0; i < count; ++i) {
    for (int d = 0; d < dimension; ++d)
      points(i, d) = coordinate(random) / 64.0;
  }
  return points;
}

class GreenIn : public testing::TestWithParam<int> {};

TEST_P(GreenIn, PointsRoundedOntoAFaceAreOnTheBoundary) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> weight(0, 1);
  for (const double offset : {0.0, 1.0, 1e4}) {
    Shape shape = Blob(GetParam());
    shape.positions.leftCols(GetParam()).array() += offset;
    const Cage cage = CageOf(shape);
    const CageFaces faces(cage);
    Positions points(3000, 3);
    for (int64_t i = 0; i < points.rows(); ++i) {
      Vec3 lambda(weight(random), weight(random),
                  GetParam() == 3 ? weight(random) : 0);
      if (i % 3 == 0) lambda[0] = 0;  // On an edge, or a corner in 2D.
      if (i % 4 == 0) lambda[1] *= 1e-9;
      lambda /= lambda.sum();
      points.row(i).setZero();
      for (int k = 0; k < GetParam(); ++k) {
        points.row(i) += lambda[k] * faces[i % faces.size()].position[k];
      }
    }
    const WeightBlock block = Evaluate(cage, points);
    for (int64_t i = 0; i < points.rows(); ++i) {
      ASSERT_EQ(block.states[i], PointState::kBoundary) << points.row(i);
      EXPECT_NEAR(block.vertex.row(i).sum(), 1, 1e-14);
    }
  }
}

TEST_P(GreenIn, ACageFarFromTheOriginLosesNoDigit) {
  Shape shape = Blob(GetParam());
  Positions points = DyadicPoints(100, GetParam());
  const WeightBlock near = Evaluate(CageOf(shape), points);
  shape.positions.leftCols(GetParam()).array() += 1 << 20;
  points.leftCols(GetParam()).array() += 1 << 20;
  const WeightBlock far = Evaluate(CageOf(shape), points);
  EXPECT_EQ(near.vertex, far.vertex);
  EXPECT_EQ(near.normal, far.normal);
}

TEST_P(GreenIn, WhatIsWithinACavityIsOutside) {
  const Shape outer = Scaled(Blob(GetParam()), 1);
  const Shape inner = Turned(Scaled(Blob(GetParam()), 0.25));
  const Cage cage = CageOf(Joined(outer, inner));
  Positions points(2, 3);
  points << 0, 0, 0, 0.5, 0, 0;
  const WeightBlock block = Evaluate(cage, points);
  EXPECT_EQ(block.states[0], PointState::kOutside);
  EXPECT_EQ(block.states[1], PointState::kInside);
}

TEST_P(GreenIn, FarOutsideEverythingStaysFinite) {
  const Cage cage = CageOf(Blob(GetParam()));
  for (const double distance : {1e3, 1e10, 1e50, 1e100}) {
    const Positions point = OnePoint(distance, -distance, 0);
    const auto evaluator = *(*FindScheme("green"))->Prepare(cage, {});
    WeightBlock block;
    evaluator->Evaluate(point, block);
    ASSERT_EQ(block.states[0], PointState::kOutside) << distance;
    for (const WeightShare& share : evaluator->Extend(point.row(0), 0)) {
      const int64_t normal = share.column - block.vertex.cols();
      (normal < 0 ? block.vertex(0, share.column) : block.normal(0, normal)) +=
          share.weight;
    }
    EXPECT_TRUE(block.vertex.allFinite()) << distance;
    EXPECT_TRUE(block.normal.allFinite()) << distance;
    // Terms of the size of the distance cancel.
    EXPECT_NEAR(block.vertex.sum(), 1, 1e-14 * distance);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimension, GreenIn, testing::Values(2, 3),
                         testing::PrintToStringParamName());

// [L08] Eq. 12 of the edge from a to b seen from the origin, as it stands, with
// eleven bits more to lose.
struct PlainEdge {
  long double phi_a, phi_b, psi;
};
PlainEdge Plain(long double ax, long double ay, long double bx,
                long double by) {
  const long double tx = bx - ax, ty = by - ay, l = std::hypot(tx, ty);
  const long double x1 = (ax * tx + ay * ty) / l, x2 = (bx * tx + by * ty) / l;
  const long double h = (ax * by - ay * bx) / l;
  const long double theta = std::atan2(h * l, ax * bx + ay * by);
  const long double r1 = std::hypot(ax, ay), r2 = std::hypot(bx, by);
  const long double lg = std::log(r2 / r1), pi2 = 2 * std::acos(-1.0L);
  return {(x2 * theta - h * lg) / (pi2 * l), (h * lg - x1 * theta) / (pi2 * l),
          -(x2 * std::log(r2) - x1 * std::log(r1) - l + h * theta) / pi2};
}

TEST(GreenIn2d, EdgesShortForTheirDistanceKeepTheirDigits) {
  // A corner cut off by an edge of 1e-6, seen from 1 to 2 away.
  const double e = 0x1p-20;
  const Eigen::Vector2d corners[] = {
      {-1, -1}, {1, -1}, {1, 1 - e}, {1 - e, 1}, {-1, 1}};
  const Cage cage = CageOf(Loop2d(corners));
  const Positions points = DyadicPoints(50, 2) * 0.5;
  const WeightBlock block = Evaluate(cage, points);
  for (int64_t i = 0; i < points.rows(); ++i) {
    std::vector<long double> phi(5), psi(5);
    for (int a = 0; a < 5; ++a) {
      const int b = (a + 1) % 5;
      const PlainEdge edge =
          Plain(corners[a].x() - points(i, 0), corners[a].y() - points(i, 1),
                corners[b].x() - points(i, 0), corners[b].y() - points(i, 1));
      phi[a] += edge.phi_a;
      phi[b] += edge.phi_b;
      psi[a] = edge.psi;
    }
    // Relative to its own size, too; the plain form in double is 6e-11 off.
    EXPECT_NEAR(block.normal(i, 2) / psi[2], 1, 1e-11);
    for (int k = 0; k < 5; ++k) {
      // What is left of long double after the cancellation: 1e-19 / e.
      EXPECT_NEAR(block.vertex(i, k), phi[k], 1e-12);
      EXPECT_NEAR(block.normal(i, k), psi[k], 1e-15);
    }
  }
}

TEST(GreenIn3d, PowersOfTwoChangeNoBitOfTheVertexWeights) {
  const Shape shape = Blob(3);
  const Positions points = DyadicPoints(100, 3);
  const WeightBlock one = Evaluate(CageOf(shape), points);
  for (const double scale : {0x1p-60, 0x1p-20, 0x1p20, 0x1p60}) {
    Shape scaled = shape;
    scaled.positions *= scale;
    const WeightBlock block = Evaluate(CageOf(scaled), points * scale);
    EXPECT_EQ(block.vertex, one.vertex) << scale;
    EXPECT_EQ(block.normal, one.normal * scale) << scale;
  }
}

}  // namespace
}  // namespace deform
