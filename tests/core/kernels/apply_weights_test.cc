#include "core/kernels/apply_weights.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace deform {
namespace {

// Runs `body` once for each instruction set that the machine has.
template <typename Body>
void ForEachInstructionSet(Body body) {
  const int64_t supported = hwy::SupportedTargets();
  int sets = 0;
  for (int bit = 0; bit < 63; ++bit) {
    const int64_t target = int64_t{1} << bit;
    if ((supported & target) == 0) continue;
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    body();
    ++sets;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  EXPECT_GT(sets, 0);
}

// Random weights in the size of real ones, and columns in [-1, 1].
struct Problem {
  Problem(int64_t tiles, int64_t columns, int64_t sets)
      : weights(tiles * kTilePoints, columns) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int64_t i = 0; i < weights.points(); ++i) {
      for (int64_t c = 0; c < columns; ++c) {
        weights.set(i, c, static_cast<float>(uniform(random)));
      }
    }
    for (int64_t k = 0; k < columns * sets * 3; ++k) {
      column.push_back(static_cast<float>(uniform(random)));
    }
    column_double.assign(column.begin(), column.end());
  }

  WeightTiles weights;
  std::vector<float> column;
  std::vector<double> column_double;
};

struct Size {
  int64_t tiles;
  int64_t columns;
  int64_t sets;
};

class ApplyWeights : public testing::TestWithParam<Size> {};

TEST_P(ApplyWeights, AgreesWithThePlainVersion) {
  // Not a structured binding: Clang 14 lets no lambda see one.
  const int64_t tiles = GetParam().tiles;
  const int64_t columns = GetParam().columns;
  const int64_t sets = GetParam().sets;
  const Problem problem(tiles, columns, sets);
  std::vector<double> judge(tiles * sets * kTileSums);
  ApplyTilesPlain(problem.weights.tile(0), tiles, columns, sets,
                  problem.column_double.data(), judge.data());
  ForEachInstructionSet([&] {
    // One float in front: the output need not be aligned.
    std::vector<float> out(judge.size() + 2, 9.0f);
    ApplyTiles(problem.weights.tile(0), tiles, columns, sets,
               problem.column.data(), out.data() + 1);
    for (size_t i = 0; i < judge.size(); ++i) {
      // Float sums: one rounding a column, of terms of at most 1.
      ASSERT_NEAR(out[i + 1], judge[i], 1.2e-7 * static_cast<double>(columns));
    }
    EXPECT_EQ(out.front(), 9.0f);
    EXPECT_EQ(out.back(), 9.0f);
  });
}

TEST_P(ApplyWeights, AddsSomeColumnsAsThePlainVersionDoes) {
  // Not a structured binding: Clang 14 lets no lambda see one.
  const int64_t tiles = GetParam().tiles;
  const int64_t columns = GetParam().columns;
  const int64_t sets = GetParam().sets;
  const Problem problem(tiles, columns, sets);
  std::vector<int32_t> index;
  for (int32_t c = 0; c < columns; c += 3) index.push_back(c);
  std::vector<double> judge(tiles * kTileSums, 5.0);
  AddTileColumnsPlain(problem.weights.tile(0), tiles, columns, index.data(),
                      static_cast<int64_t>(index.size()),
                      problem.column_double.data(), judge.data());
  ForEachInstructionSet([&] {
    std::vector<double> out(judge.size() + 1, 5.0);
    AddTileColumns(problem.weights.tile(0), tiles, columns, index.data(),
                   static_cast<int64_t>(index.size()),
                   problem.column_double.data(), out.data());
    for (size_t i = 0; i < judge.size(); ++i) {
      ASSERT_NEAR(out[i], judge[i], 1e-13);  // Double sums of at most 110.
    }
    EXPECT_EQ(out.back(), 5.0);
  });
}

TEST_P(ApplyWeights, AppliesFewBesideTheOthersAsThePlainVersionDoes) {
  const int64_t tiles = GetParam().tiles;
  const int64_t columns = GetParam().columns;
  const Problem problem(tiles, columns, 1);
  const std::vector<float> base(tiles * kTileSums, 5.0f);
  std::vector<double> judge(tiles * kTileSums);
  ApplyTilesBesidePlain(base.data(), problem.weights.tile(0), tiles, columns,
                        problem.column_double.data(), judge.data());
  ForEachInstructionSet([&] {
    std::vector<float> out(judge.size() + 2, 9.0f);
    ApplyTilesBeside(base.data(), problem.weights.tile(0), tiles, columns,
                     problem.column.data(), out.data() + 1);
    for (size_t i = 0; i < judge.size(); ++i) {
      // Float sums: one rounding a column, of sums that begin at 5.
      ASSERT_NEAR(out[i + 1], judge[i],
                  3e-7 + 3e-7 * static_cast<double>(columns));
    }
    EXPECT_EQ(out.front(), 9.0f);
    EXPECT_EQ(out.back(), 9.0f);
  });
}

INSTANTIATE_TEST_SUITE_P(Sizes, ApplyWeights,
                         testing::ValuesIn<Size>({{0, 5, 1},
                                                  {1, 0, 1},
                                                  {1, 1, 1},
                                                  {1, 326, 1},
                                                  {2, 17, 1},
                                                  {3, 16, 1},
                                                  {4, 15, 1},
                                                  {5, 44, 1},
                                                  {9, 326, 1},
                                                  {1, 7, 2},
                                                  {2, 7, 3},
                                                  {3, 7, 4},
                                                  {4, 31, 5},
                                                  {5, 9, 8},
                                                  {7, 3, 33}}),
                         [](const auto& test) {
                           const Size& s = test.param;
                           return std::to_string(s.tiles) + "Tiles" +
                                  std::to_string(s.columns) + "Columns" +
                                  std::to_string(s.sets) + "Sets";
                         });

TEST(ApplyWeights, PassesOnWhatIsNotANumberAndInfinity) {
  Problem problem(2, 4, 1);
  problem.weights.set(3, 1, std::numeric_limits<float>::quiet_NaN());
  problem.weights.set(20, 2, std::numeric_limits<float>::infinity());
  ForEachInstructionSet([&] {
    std::vector<float> out(2 * kTileSums);
    ApplyTiles(problem.weights.tile(0), 2, 4, 1, problem.column.data(),
               out.data());
    for (size_t i = 0; i < out.size(); ++i) {
      const size_t point = i / kTileSums * kTilePoints + i % kTilePoints;
      EXPECT_EQ(std::isnan(out[i]), point == 3);
      EXPECT_EQ(std::isinf(out[i]), point == 20);
    }
  });
}

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
