#include "core/kernels/apply_mixed.h"

#include <gtest/gtest.h>

#include <algorithm>

#include <hwy/targets.h>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "core/kernels/apply_weights.h"
#include "core/kernels/zeroed_array.h"
#include "tests/support/instruction_sets.h"

namespace deform {
namespace {

struct Size {
  int64_t blocks;
  MixedColumns columns;
};

class ApplyMixedColumns : public testing::TestWithParam<Size> {};

// Numbers of about 1 after their coefficients, whatever their kind; the ends
// of the ranges of integers among them.
struct Problem {
  explicit Problem(const Size& size)
      // At least one, so that there is a place even for none.
      : numbers(
            std::max<int64_t>(1, size.blocks * size.columns.block_bytes())) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const MixedColumns& columns = size.columns;
    std::byte* at = numbers.data();
    for (int64_t b = 0; b < size.blocks; ++b) {
      for (int64_t i = 0; i < columns.floats * kBlockPoints; ++i) {
        Put(static_cast<float>(uniform(random)), at);
      }
      for (int64_t i = 0; i < columns.shorts * kBlockPoints; ++i) {
        Put(static_cast<int16_t>(i % 9 == 0 ? -32768 : 32767 * uniform(random)),
            at);
      }
      for (int64_t i = 0; i < columns.bytes * kBlockPoints; ++i) {
        Put(static_cast<int8_t>(i % 7 == 0 ? -128 : 127 * uniform(random)), at);
      }
    }
    for (int64_t k = 0; k <= columns.count(); ++k) {
      const double unit = k <= columns.floats                    ? 1
                          : k <= columns.floats + columns.shorts ? 1.0 / 32768
                                                                 : 1.0 / 128;
      for (int d = 0; d < 3; ++d) {
        column.push_back(static_cast<float>(unit * uniform(random)));
      }
    }
  }

  template <typename Number>
  static void Put(Number number, std::byte*& at) {
    std::memcpy(at, &number, sizeof(number));
    at += sizeof(number);
  }

  ZeroedArray<std::byte> numbers;
  std::vector<float> column;
};

TEST_P(ApplyMixedColumns, AgreesWithThePlainVersion) {
  const auto& [blocks, columns] = GetParam();
  const Problem problem(GetParam());
  std::vector<double> judge(blocks * kBlockTiles * kTileSums);
  const std::vector<double> in_double(problem.column.begin(),
                                      problem.column.end());
  ApplyMixedPlain(problem.numbers.data(), blocks, columns, in_double.data(),
                  judge.data());
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    const OnInstructionSet on(target);
    std::vector<float> out(judge.size() + 2, 9.0F);
    ApplyMixed(problem.numbers.data(), blocks, columns, problem.column.data(),
               out.data() + 1);
    for (size_t i = 0; i < judge.size(); ++i) {
      // Float sums: one rounding a column, of sums of at most as many.
      const auto terms = static_cast<double>(columns.count() + 1);
      ASSERT_NEAR(out[i + 1], judge[i], 6e-8 * terms * terms);
    }
    EXPECT_EQ(out.front(), 9.0F);
    EXPECT_EQ(out.back(), 9.0F);
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, ApplyMixedColumns,
                         testing::ValuesIn<Size>({{0, {1, 1, 1}},
                                                  {1, {0, 0, 0}},
                                                  {1, {1, 0, 0}},
                                                  {1, {0, 1, 0}},
                                                  {1, {0, 0, 1}},
                                                  {2, {2, 3, 5}},
                                                  {5, {0, 4, 17}},
                                                  {3, {7, 1, 0}}}),
                         [](const auto& test) {
                           const Size& s = test.param;
                           return std::to_string(s.blocks) + "Blocks" +
                                  std::to_string(s.columns.floats) + "Floats" +
                                  std::to_string(s.columns.shorts) + "Shorts" +
                                  std::to_string(s.columns.bytes) + "Bytes";
                         });

}  // namespace
}  // namespace deform
