#include "core/kernels/grid_blocks.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/instruction_sets.h"

namespace deform {
namespace {

using Numbers = std::array<int32_t, kGridBlock>;
using Words = std::array<uint32_t, kGridBlock>;

// A block at rest and moved, by about `motion`, with numbers up to `size`.
struct Blocks {
  Blocks(int32_t size, int32_t motion, uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int32_t> places(-size, size);
    std::uniform_int_distribution<int32_t> motions(-motion, motion);
    for (int d = 0; d < 3; ++d) {
      for (int64_t i = 0; i < kGridBlock; ++i) {
        before[d][i] = places(random);
        after[d][i] =
            static_cast<int32_t>(static_cast<uint32_t>(before[d][i]) +
                                 static_cast<uint32_t>(motions(random)));
      }
    }
  }
  GridBlock Reference() const {
    return {{before[0].data(), before[1].data(), before[2].data()}};
  }
  GridBlock Moved() const {
    return {{after[0].data(), after[1].data(), after[2].data()}};
  }

  Numbers before[3];
  Numbers after[3];
};

constexpr int32_t kMax = std::numeric_limits<int32_t>::max();
// From a block at one place to any integers whatever.
constexpr std::pair<int32_t, int32_t> kSizes[] = {
    {0, 0}, {1, 1}, {1000, 50}, {1 << 20, 1 << 12}, {kMax, kMax}};

void OnEveryInstructionSet(const std::function<void()>& check) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    const OnInstructionSet on(target);
    check();
  }
}

TEST(GridBlocks, RoundingIsThatOfThePlainVersion) {
  std::mt19937 random(9);
  for (const float reach : {1.0F, 1e3F, 1e9F}) {
    std::uniform_real_distribution<float> uniform(-reach, reach);
    std::array<float, kGridBlock> x;
    for (float& number : x) number = uniform(random);
    x[7] = 0.5F * reach;  // Ties, and the limit itself.
    x[8] = std::min(1.5F, reach);
    x[9] = -reach;
    for (const double per_step : {1.0, 0.37}) {
      Numbers judge;
      ASSERT_TRUE(RoundToGridPlain(x.data(), per_step, reach, judge.data()));
      std::array<float, kGridBlock> judge_back;
      LeaveGridPlain(judge.data(), 1 / per_step, judge_back.data());
      OnEveryInstructionSet([&] {
        Numbers grid;
        EXPECT_TRUE(RoundToGrid(x.data(), per_step, reach, grid.data()));
        EXPECT_EQ(grid, judge);
        std::array<float, kGridBlock> back;
        LeaveGrid(judge.data(), 1 / per_step, back.data());
        EXPECT_EQ(back, judge_back);
      });
    }
  }
}

TEST(GridBlocks, RoundingTellsOfEveryNumberBeyondTheLimit) {
  for (const float bad :
       {5.001F, -5.001F, 3e38F, std::numeric_limits<float>::infinity(),
        std::numeric_limits<float>::quiet_NaN()}) {
    for (int64_t at = 0; at < kGridBlock; ++at) {
      std::array<float, kGridBlock> x = {};
      x[at] = bad;
      Numbers grid;
      ASSERT_FALSE(RoundToGridPlain(x.data(), 1, 5, grid.data()));
      OnEveryInstructionSet(
          [&] { ASSERT_FALSE(RoundToGrid(x.data(), 1, 5, grid.data())); });
    }
  }
}

TEST(GridBlocks, ExtentsAreThoseOfThePlainVersion) {
  for (const auto& [size, motion] : kSizes) {
    const Blocks blocks(size, motion, 1);
    const GridExtent judge =
        MeasureExtentPlain(blocks.Reference(), blocks.Moved());
    OnEveryInstructionSet([&] {
      const GridExtent extent =
          MeasureExtent(blocks.Reference(), blocks.Moved());
      for (int d = 0; d < 3; ++d) {
        EXPECT_EQ(extent.place[d], judge.place[d]);
        EXPECT_EQ(extent.motion[d], judge.motion[d]);
      }
    });
  }
}

TEST(GridBlocks, MomentsAreThoseOfThePlainVersion) {
  // The largest that sums have room for: 11 bits and a sign, differences of
  // numbers of 10 bits.
  const Blocks blocks(1023, 511, 2);
  for (const int shift : {0, 3}) {
    const int motion_shift[3] = {0, shift, 1};
    const GridMoments judge = SumMomentsPlain(
        blocks.Reference(), blocks.Moved(), shift, motion_shift);
    OnEveryInstructionSet([&] {
      const GridMoments sums =
          SumMoments(blocks.Reference(), blocks.Moved(), shift, motion_shift);
      // Members are integers without gaps.
      EXPECT_EQ(std::memcmp(&sums, &judge, sizeof(sums)), 0);
    });
  }
}

const GridPrediction kPredictions[] = {
    {},
    {.offset = -7},
    {.shift = 2, .offset = 300, .gradient = {5, -3, 127}, .fraction = 9},
    {.offset = 1, .gradient = {1, 0, 0}, .fraction = 0},
    {.shift = 31,
     .offset = kMax,
     .gradient = {-32768, 32767, 1},
     .fraction = 31},
};

TEST(GridBlocks, ResidualsAreThoseOfThePlainVersionAndGiveTheGridBack) {
  for (const auto& [size, motion] : kSizes) {
    const Blocks blocks(size, motion, 3);
    for (const GridPrediction& prediction : kPredictions) {
      for (int d = 0; d < 3; ++d) {
        Words judge;
        FoldResidualsPlain(blocks.Reference(), d, blocks.after[d].data(),
                           prediction, judge.data());
        Numbers back;
        AddResidualsPlain(blocks.Reference(), d, judge.data(), prediction,
                          back.data());
        EXPECT_EQ(back, blocks.after[d]);
        OnEveryInstructionSet([&] {
          Words folded;
          FoldResiduals(blocks.Reference(), d, blocks.after[d].data(),
                        prediction, folded.data());
          EXPECT_EQ(folded, judge);
          AddResiduals(blocks.Reference(), d, folded.data(), prediction,
                       back.data());
          EXPECT_EQ(back, blocks.after[d]);
        });
      }
    }
  }
}

TEST(GridBlocks, FoldingPutsSmallMagnitudesFirst) {
  Blocks blocks(0, 0, 4);
  for (int32_t i = 0; i < 5; ++i) {
    blocks.after[0][i] = std::array{0, -1, 1, -2, 2}[i];
  }
  Words folded;
  FoldResiduals(blocks.Reference(), 0, blocks.after[0].data(), {},
                folded.data());
  for (uint32_t i = 0; i < 5; ++i) EXPECT_EQ(folded[i], i);
}

TEST(GridBlocks, PlanesAreThoseOfThePlainVersionAtEveryWidth) {
  std::mt19937 random(5);
  uint32_t values[kGridGroup];
  for (uint32_t& value : values) value = random();
  for (int bits = 0; bits <= 32; ++bits) {
    const int64_t size = bits * kGridGroup / 8;
    std::vector<uint8_t> judge(size + 1, 0xEE);
    PackBitsPlain(values, bits, judge.data());
    uint32_t low[kGridGroup];
    UnpackBitsPlain(judge.data(), bits, low);
    for (int64_t i = 0; i < kGridGroup; ++i) {
      ASSERT_EQ(low[i], bits == 32 ? values[i]
                                   : values[i] & ((uint32_t{1} << bits) - 1));
    }
    OnEveryInstructionSet([&] {
      std::vector<uint8_t> planes(size + 1, 0xEE);  // None behind the last.
      PackBits(values, bits, planes.data());
      EXPECT_EQ(planes, judge);
      planes.resize(size);
      uint32_t back[kGridGroup];
      UnpackBits(planes.data(), bits, back);
      EXPECT_TRUE(std::equal(back, back + kGridGroup, low));
    });
  }
}

}  // namespace
}  // namespace deform
