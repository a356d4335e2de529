#include "core/frames/grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "core/base/error.h"

namespace deform {
namespace {

constexpr double kStep = 1e-5;

PointOrder RandomOrder(int64_t points) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  return PointOrder(
      Positions::NullaryExpr(points, 3, [&] { return uniform(random); }));
}

TEST(Grid, GivesPointsBackWithinItsStepUpToItsEnd) {
  std::mt19937 random(3);
  for (const int dimension : {2, 3}) {
    for (const double reach : {1e-6, 1.0, kStep * kGridLimit * 0.999999}) {
      std::uniform_real_distribution<double> uniform(-reach, reach);
      for (const int64_t points : {0, 1, 255, 256, 257, 5000}) {
        const PointOrder order = RandomOrder(points);
        // What was meant, before it was rounded to float.
        std::vector<double> meant(points * dimension);
        for (double& x : meant) x = uniform(random);
        const std::vector<float> positions(meant.begin(), meant.end());
        const auto grid = PutOnGrid(positions, dimension, kStep, order);
        ASSERT_TRUE(grid.ok()) << grid.status();
        std::vector<float> back(positions.size());
        TakeOffGrid(*grid, kStep, order, dimension, back);
        for (int64_t i = 0; i < points; ++i) {
          double squares = 0;
          for (int d = 0; d < dimension; ++d) {
            squares +=
                std::pow(back[i * dimension + d] - meant[i * dimension + d], 2);
          }
          ASSERT_LE(std::sqrt(squares), kStep);
        }
      }
    }
  }
}

TEST(Grid, RoundsToTheNearestInteger) {
  const PointOrder order = RandomOrder(1);
  const auto grid =
      PutOnGrid(std::vector<float>{1.49F, -1.51F, -1048576.0F}, 3, 1, order);
  ASSERT_TRUE(grid.ok());
  EXPECT_EQ(*grid->coordinate(0), 1);
  EXPECT_EQ(*grid->coordinate(1), -2);
  EXPECT_EQ(*grid->coordinate(2), -1048576);
}

TEST(Grid, FillsItsLastBlockWithTheLastPoint) {
  const PointOrder order = RandomOrder(257);
  std::vector<float> positions(257 * 3);
  for (size_t i = 0; i < positions.size(); ++i) {
    positions[i] = static_cast<float>(i);
  }
  const auto grid = PutOnGrid(positions, 3, 1, order);
  ASSERT_TRUE(grid.ok());
  EXPECT_EQ(grid->padded_size(), 512);
  for (int d = 0; d < 3; ++d) {
    for (int64_t i = 256; i < 512; ++i) {
      EXPECT_EQ(grid->coordinate(d)[i], order.points()[256] * 3 + d);
    }
  }
}

TEST(Grid, NamesThePointThatItDoesNotReach) {
  const PointOrder order = RandomOrder(300);
  for (const int d : {0, 1, 2}) {
    std::vector<float> positions(900);
    positions[3 * 270 + d] = -1048577;
    const absl::Status status = PutOnGrid(positions, 3, 1, order).status();
    EXPECT_EQ(DetailOf(status).reason, "OUT_OF_GRID");
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(status.message(),
              "point 270 is 1.04858e+06 from the origin; a grid of step 1 "
              "reaches to 1.04858e+06");
  }
}

TEST(Grid, RefusesWhatIsNotFinite) {
  const PointOrder order = RandomOrder(300);
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(),
                          std::numeric_limits<float>::infinity()}) {
    for (const int d : {0, 1, 2}) {
      std::vector<float> positions(900);
      positions[3 * 299 + d] = bad;
      const absl::Status status =
          PutOnGrid(positions, 3, kStep, order).status();
      EXPECT_EQ(DetailOf(status).reason, "NON_FINITE");
      EXPECT_EQ(status.message(),
                "point 299 has a coordinate that is not finite");
    }
  }
}

TEST(Grid, HasToleranceWithinFloats) {
  EXPECT_TRUE(CheckTolerance(1e-30).ok());
  EXPECT_TRUE(CheckTolerance(1e28).ok());
  for (const double bad :
       {0.0, -1.0, 1e-31, 1e29, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(DetailOf(CheckTolerance(bad)).reason, "TOLERANCE_OUT_OF_RANGE");
  }
  EXPECT_EQ(CheckTolerance(0).message(),
            "tolerance is 0, not within 1e-30 and 1e28");
}

}  // namespace
}  // namespace deform
