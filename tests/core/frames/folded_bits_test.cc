#include "core/frames/folded_bits.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace deform {
namespace {

TEST(FoldedBits, FoldSmallMagnitudesToSmallNumbers) {
  const int32_t numbers[] = {0, -1, 1, -2, 2};
  for (uint32_t i = 0; i < 5; ++i) {
    EXPECT_EQ(Folded(numbers[i]), i);
    EXPECT_EQ(Unfolded(i), numbers[i]);
  }
  for (const int32_t extreme : {std::numeric_limits<int32_t>::min(),
                                std::numeric_limits<int32_t>::max()}) {
    EXPECT_EQ(Unfolded(Folded(extreme)), extreme);
  }
}

// A reader written after the header alone must read these for ever.
TEST(FoldedBits, AreTheseBits) {
  std::vector<uint8_t> bytes;
  FoldedBitWriter writer(bytes);
  writer.Put(-1, 0);  // f = 1: 0 1
  writer.Put(3, 2);   // f = 6: 0 1, 0 1
  writer.Put(0, 3);   // f = 0: 1, 0 0 0
  writer.Finish();    // 0 0 0 0 0 0
  // In turn, lowest bit first: 0101 0110 0000 0000.
  EXPECT_EQ(bytes, (std::vector<uint8_t>{0b01101010, 0}));
}

TEST(FoldedBits, ComeBackAndTakeAsManyAsTheySay) {
  std::mt19937 random(1);
  for (int round = 0; round < 100; ++round) {
    std::vector<std::pair<int32_t, int>> numbers;
    std::vector<uint8_t> bytes;
    FoldedBitWriter writer(bytes);
    int64_t bits = 0;
    for (int i = 0; i < 50; ++i) {
      const int k = static_cast<int>(random() % 32);
      // Up to some 300 zeros.
      const uint64_t folded = random() % (uint64_t{300} << k);
      const int32_t number = Unfolded(static_cast<uint32_t>(folded));
      numbers.emplace_back(number, k);
      writer.Put(number, k);
      bits += FoldedBits(number, k);
    }
    writer.Finish();
    EXPECT_EQ(std::ssize(bytes), (bits + 7) / 8);
    FoldedBitReader reader(bytes);
    for (const auto& [number, k] : numbers) {
      int32_t read = 0;
      ASSERT_TRUE(reader.Take(k, read));
      EXPECT_EQ(read, number);
    }
    EXPECT_TRUE(reader.done());
  }
}

TEST(FoldedBits, EndWhereTheBytesDo) {
  int32_t number = 0;
  EXPECT_FALSE(FoldedBitReader({}).Take(0, number));
  EXPECT_TRUE(FoldedBitReader({}).done());
  const std::vector<uint8_t> zeros(20, 0);
  EXPECT_FALSE(FoldedBitReader(zeros).Take(0, number));
  const std::vector<uint8_t> one = {1};
  EXPECT_FALSE(FoldedBitReader(one).Take(8, number));
  EXPECT_TRUE(FoldedBitReader(one).Take(7, number));
}

TEST(FoldedBits, AreNeitherBeyond32BitsNorFollowedByOthers) {
  // 2^4 zeros with 28 bits behind their 1 would be 2^32 and more.
  std::vector<uint8_t> bytes = {0, 0, 1, 0, 0, 0};
  int32_t number = 0;
  EXPECT_FALSE(FoldedBitReader(bytes).Take(28, number));
  bytes = {0, 0x80, 0, 0, 0, 0};
  EXPECT_TRUE(FoldedBitReader(bytes).Take(28, number));
  EXPECT_EQ(Folded(number), uint32_t{15} << 28);

  const std::vector<uint8_t> filled = {0b00000001};
  FoldedBitReader good(filled);
  EXPECT_FALSE(good.done());
  EXPECT_TRUE(good.Take(0, number));
  EXPECT_TRUE(good.done());
  const std::vector<uint8_t> not_filled = {0b10000001};
  FoldedBitReader bad(not_filled);
  EXPECT_TRUE(bad.Take(0, number));
  EXPECT_FALSE(bad.done());
  const std::vector<uint8_t> longer = {1, 0};
  FoldedBitReader long_one(longer);
  EXPECT_TRUE(long_one.Take(0, number));
  EXPECT_FALSE(long_one.done());
}

}  // namespace
}  // namespace deform
