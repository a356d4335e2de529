// What is special about Green coordinates; what all schemes promise is in
// scheme_property_test.cc, reference values are in tests/golden.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

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
    evaluator->Extend(
        point.row(0), 0,
        {block.vertex.data(), static_cast<size_t>(block.vertex.size())},
        {block.normal.data(), static_cast<size_t>(block.normal.size())});
    EXPECT_TRUE(block.vertex.allFinite()) << distance;
    EXPECT_TRUE(block.normal.allFinite()) << distance;
    // Terms of the size of the distance cancel.
    EXPECT_NEAR(block.vertex.sum(), 1, 1e-14 * distance);
  }
}

INSTANTIATE_TEST_SUITE_P(Dimension, GreenIn, testing::Values(2, 3),
                         testing::PrintToStringParamName());

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

TEST(GreenIn3d, CageThatWindsTwiceAroundAPointIsFound) {
  const Cage cage = CageOf(Joined(Cuboid({-3, -0.9, -0.9}, {3, 0.9, 0.9}),
                                  Cuboid({-0.9, -3, -0.8}, {0.9, 3, 0.8})));
  const WeightBlock block = Evaluate(cage, OnePoint(0.1, 0.2, 0.3));
  EXPECT_EQ(block.states[0], PointState::kOverlap);
  EXPECT_EQ(block.vertex.norm(), 0);
}

}  // namespace
}  // namespace deform
