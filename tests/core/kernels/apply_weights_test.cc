#include "core/kernels/apply_weights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace deform {
namespace {

// Random weights in the size of real ones, and columns in [-1, 1].
struct Problem {
  Problem(int64_t points, int64_t columns) : weights(points, columns) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int64_t i = 0; i < points; ++i) {
      for (int64_t c = 0; c < columns; ++c) {
        weights.set(i, c, static_cast<float>(uniform(random)));
      }
    }
    for (int64_t k = 0; k < columns * 3; ++k) column.push_back(uniform(random));
  }

  WeightTiles weights;
  std::vector<double> column;
};

class ApplyWeights : public testing::TestWithParam<int> {};

TEST_P(ApplyWeights, AgreesWithThePlainVersion) {
  const int columns = GetParam();
  const Problem problem(40, columns);
  const std::vector<float> column(problem.column.begin(), problem.column.end());
  for (int64_t t = 0; t < problem.weights.tiles(); ++t) {
    double judge[3 * kTilePoints];
    float fast[3 * kTilePoints];
    ApplyTilePlain(problem.weights.tile(t), columns, problem.column.data(),
                   judge);
    ApplyTile(problem.weights.tile(t), columns, column.data(), fast);
    for (int i = 0; i < 3 * kTilePoints; ++i) {
      // Float sums: one rounding a column, of terms of at most 1.
      EXPECT_NEAR(fast[i], judge[i], 1.2e-7 * (columns + 1));
    }
  }
}

TEST_P(ApplyWeights, AddingAllColumnsIsApplyingThem) {
  const int columns = GetParam();
  const Problem problem(17, columns);
  std::vector<int32_t> index;
  for (int c = 0; c < columns; ++c) index.push_back(c);
  for (int64_t t = 0; t < problem.weights.tiles(); ++t) {
    double judge[3 * kTilePoints];
    double sums[3 * kTilePoints];
    std::fill(std::begin(sums), std::end(sums), 5.0);
    ApplyTilePlain(problem.weights.tile(t), columns, problem.column.data(),
                   judge);
    AddTileColumns(problem.weights.tile(t), index.data(), columns,
                   problem.column.data(), sums);
    for (int i = 0; i < 3 * kTilePoints; ++i) {
      EXPECT_NEAR(sums[i], judge[i] + 5, 1e-13);  // Double sums.
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Columns, ApplyWeights,
                         testing::Values(0, 1, 2, 15, 16, 17, 326));

TEST(WeightTiles, PadTheLastTileWithZeros) {
  WeightTiles tiles(17, 3);
  tiles.set(16, 2, 4.0f);
  EXPECT_EQ(tiles.tiles(), 2);
  EXPECT_EQ(tiles.at(16, 2), 4.0f);
  EXPECT_EQ(tiles.bytes(), 2 * 3 * 16 * 4);
  EXPECT_EQ(tiles.tile(1)[2 * kTilePoints + 1], 0.0f);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(tiles.tile(0)) % 64, 0u);
}

TEST(WeightTiles, MayBeEmpty) {
  EXPECT_EQ(WeightTiles().tiles(), 0);
  EXPECT_EQ(WeightTiles(5, 0).bytes(), 0);
}

}  // namespace
}  // namespace deform
