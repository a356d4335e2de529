#include "core/deform/moved_columns.h"

#include <gmock/gmock.h>

#include <memory>
#include <vector>

namespace deform {
namespace {

using testing::ElementsAre;
using Columns = std::vector<int32_t>;

constexpr int64_t kPoints = 40000;
constexpr int64_t kColumns = 40;

// The weight of point i and column c is 100 i + c.
const WeightTiles& Weights() {
  static const WeightTiles* const weights = [] {
    auto* all = new WeightTiles(kPoints, kColumns);
    for (int64_t i = 0; i < kPoints; ++i) {
      for (int64_t c = 0; c < kColumns; ++c) {
        all->set(i, c, static_cast<float>(100 * i + c));
      }
    }
    return all;
  }();
  return *weights;
}

TEST(MovedColumns, AreCopiedWhenTheyMoveAgain) {
  MovedColumns moved(Unlimited());
  EXPECT_FALSE(moved.Expects(Weights(), Columns{3, 7}));
  EXPECT_FALSE(moved.Follow(Weights(), Columns{3, 7}, true));
  EXPECT_TRUE(moved.Expects(Weights(), Columns{3, 7}));
  EXPECT_TRUE(moved.Follow(Weights(), Columns{3, 7}, true));
  EXPECT_THAT(moved.copied(), ElementsAre(3, 7));
  EXPECT_EQ(moved.bytes(), kPoints * 2 * 4);
  moved.Fill(Weights(), 0, Weights().tiles());
  for (const int64_t point : {0, 15, 16, 39999}) {
    const float* tile = moved.tile(point / kTilePoints) + point % kTilePoints;
    EXPECT_EQ(tile[0], Weights().at(point, 3));
    EXPECT_EQ(tile[kTilePoints], Weights().at(point, 7));
  }
}

TEST(MovedColumns, ServeStepsThatMoveMostOfThem) {
  MovedColumns moved(Unlimited());
  moved.Follow(Weights(), Columns{1, 2, 3, 4}, true);
  EXPECT_TRUE(moved.Follow(Weights(), Columns{2, 4}, true));
  EXPECT_THAT(moved.copied(), ElementsAre(1, 2, 3, 4));
  EXPECT_FALSE(moved.Expects(Weights(), Columns{5}));
  EXPECT_FALSE(moved.Expects(Weights(), Columns{1}));  // Reads three in vain.
}

TEST(MovedColumns, AreForgottenWhenOthersMove) {
  MovedColumns moved(Unlimited());
  moved.Follow(Weights(), Columns{1}, true);
  moved.Follow(Weights(), Columns{1}, true);
  EXPECT_FALSE(moved.Follow(Weights(), Columns{2, 3, 4}, true));
  EXPECT_EQ(moved.bytes(), 0);
  EXPECT_TRUE(moved.Follow(Weights(), Columns{2, 3, 4}, true));
  EXPECT_THAT(moved.copied(), ElementsAre(2, 3, 4));
}

TEST(MovedColumns, OfTwoWhoTakeTurnsAreCopiedTogether) {
  MovedColumns moved(Unlimited());
  moved.Follow(Weights(), Columns{1, 2}, true);
  moved.Follow(Weights(), Columns{8, 9}, true);
  EXPECT_TRUE(moved.Follow(Weights(), Columns{1, 2}, true));
  EXPECT_THAT(moved.copied(), ElementsAre(1, 2, 8, 9));
  EXPECT_TRUE(moved.Follow(Weights(), Columns{8, 9}, true));
}

TEST(MovedColumns, OutliveAFullPassOverTheSameColumns) {
  MovedColumns moved(Unlimited());
  moved.Follow(Weights(), Columns{1, 2}, true);
  moved.Follow(Weights(), Columns{1, 2}, true);
  moved.Fill(Weights(), 0, Weights().tiles());
  EXPECT_FALSE(moved.Follow(Weights(), Columns{1, 2}, false));
  EXPECT_TRUE(moved.Follow(Weights(), Columns{1, 2}, true));
  moved.Fill(Weights(), 0, Weights().tiles());
  EXPECT_EQ(moved.tile(1)[0], Weights().at(16, 1));
}

TEST(MovedColumns, AreNotCopiedFromSmallWeights) {
  const WeightTiles small(100, kColumns);
  MovedColumns moved(Unlimited());
  moved.Follow(small, Columns{1}, true);
  EXPECT_FALSE(moved.Expects(small, Columns{1}));
  EXPECT_FALSE(moved.Follow(small, Columns{1}, true));
}

TEST(MovedColumns, OfAllSessionsStayWithinTheirAllowance) {
  // Never written, so none of it is real memory.
  const WeightTiles large(3'000'000, 4);
  const Columns columns = {0, 1, 2, 3};  // 48 MB, and 72 MB beside.
  Allowance two(int64_t{256} << 20);
  std::vector<std::unique_ptr<MovedColumns>> sessions;
  for (int k = 0; k < 3; ++k) {
    sessions.push_back(std::make_unique<MovedColumns>(two));
    sessions[k]->Follow(large, columns, true);
  }
  EXPECT_TRUE(sessions[0]->Follow(large, columns, true));
  EXPECT_TRUE(sessions[1]->Follow(large, columns, true));
  EXPECT_FALSE(sessions[2]->Expects(large, columns));
  EXPECT_FALSE(sessions[2]->Follow(large, columns, true));
  EXPECT_TRUE(sessions[1]->Follow(large, columns, true));
  sessions[0] = nullptr;
  EXPECT_TRUE(sessions[2]->Follow(large, columns, true));
}

}  // namespace
}  // namespace deform
