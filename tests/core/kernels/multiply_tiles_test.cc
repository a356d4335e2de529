#include "core/kernels/multiply_tiles.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <random>
#include <string>
#include <vector>

#include "core/kernels/weight_tiles.h"
#include "tests/support/instruction_sets.h"

namespace deform {
namespace {

std::vector<double> RandomNumbers(int64_t count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> numbers;
  numbers.reserve(count + 1);  // Not null, even if empty.
  for (int64_t i = 0; i < count; ++i) numbers.push_back(uniform(random));
  return numbers;
}

struct Size {
  int64_t tiles;
  int64_t inner;
  int64_t outer;
};

class MultiplyTiles : public testing::TestWithParam<Size> {};

TEST_P(MultiplyTiles, AddsTheProductsThatThePlainVersionDoes) {
  const auto [tiles, inner, outer] = GetParam();
  const auto a = RandomNumbers(tiles * inner * kTilePoints);
  const auto b = RandomNumbers(inner * outer);
  std::vector<double> judge(tiles * outer * kTilePoints, 2.0);
  AddTileProductsPlain(a.data(), tiles, inner, b.data(), outer, judge.data());
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    const OnInstructionSet on(target);
    // One number in front: nothing need be aligned.
    std::vector<double> out(judge.size() + 2, 2.0);
    AddTileProducts(a.data(), tiles, inner, b.data(), outer, out.data() + 1);
    for (size_t i = 0; i < judge.size(); ++i) {
      ASSERT_NEAR(out[i + 1], judge[i], 1e-13);  // Double sums of at most 100.
    }
    EXPECT_EQ(out.front(), 2.0);
    EXPECT_EQ(out.back(), 2.0);
  }
}

TEST_P(MultiplyTiles, AddsTheGramMatrixThatThePlainVersionDoes) {
  const auto [tiles, columns, unused] = GetParam();
  const auto a = RandomNumbers(tiles * columns * kTilePoints);
  std::vector<double> judge(columns * columns, 1.0);
  AddTileGramPlain(a.data(), tiles, columns, judge.data());
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    const OnInstructionSet on(target);
    std::vector<double> out(judge.size() + 1, 1.0);
    AddTileGram(a.data(), tiles, columns, out.data());
    for (size_t i = 0; i < judge.size(); ++i) {
      ASSERT_NEAR(out[i], judge[i], 1e-13);  // Double sums of at most 112.
    }
    EXPECT_EQ(out.back(), 1.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, MultiplyTiles,
                         testing::ValuesIn<Size>({{0, 3, 4},
                                                  {1, 0, 5},
                                                  {1, 1, 1},
                                                  {2, 5, 11},
                                                  {3, 4, 12},
                                                  {2, 7, 13},
                                                  {1, 31, 25},
                                                  {7, 9, 40},
                                                  {1, 100, 3}}),
                         [](const auto& test) {
                           const Size& s = test.param;
                           return std::to_string(s.tiles) + "Tiles" +
                                  std::to_string(s.inner) + "Times" +
                                  std::to_string(s.outer);
                         });

}  // namespace
}  // namespace deform
