#include "core/frames/point_order.h"

#include <gtest/gtest.h>

#include <random>

#include "core/base/error.h"

namespace deform {
namespace {

TEST(PointOrder, FollowsMortonsCurve) {
  Positions corners(9, 3);
  // The corners of a cube from the last to the first, and its centre, whose
  // coordinates fall into the lower halves: 1048575 / 2 is rounded down.
  for (int i = 0; i < 8; ++i) {
    corners.row(i) << (7 - i) / 4 % 2, (7 - i) / 2 % 2, (7 - i) % 2;
  }
  corners.row(8) << 0.5, 0.5, 0.5;
  EXPECT_EQ(PointOrder(corners).points(),
            (std::vector<int32_t>{7, 8, 6, 5, 4, 3, 2, 1, 0}));
}

TEST(PointOrder, KeepsPointsAtOnePlaceInOrder) {
  EXPECT_EQ(PointOrder(Positions::Constant(4, 3, 1e90)).points(),
            (std::vector<int32_t>{0, 1, 2, 3}));
  EXPECT_EQ(PointOrder(Positions(0, 3)).size(), 0);
}

TEST(PointOrder, ComesBackFromItsBytes) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-3, 3);
  const PointOrder order(
      Positions::NullaryExpr(1000, 3, [&] { return uniform(random); }));
  const auto back = PointOrder::FromBytes(order.ToBytes(), 1000);
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->points(), order.points());
  EXPECT_EQ(PointOrder(Positions(0, 3)).ToBytes().size(), 0u);
  EXPECT_TRUE(PointOrder::FromBytes({}, 0).ok());
}

TEST(PointOrder, RefusesWhatIsNoOrder) {
  const auto message = [](std::vector<uint8_t> bytes) {
    const absl::Status status = PointOrder::FromBytes(bytes, 2).status();
    EXPECT_EQ(DetailOf(status).reason, "BAD_POINT_ORDER");
    return std::string(status.message());
  };
  EXPECT_EQ(message({0, 0, 0}), "the order has 3 bytes, 2 points need 8");
  EXPECT_EQ(message({0, 0, 0, 0}), "the order has 4 bytes, 2 points need 8");
  EXPECT_EQ(message({0, 0, 0, 0, 2, 0, 0, 0}), "the order names point 2 of 2");
  EXPECT_EQ(message({0, 0, 0, 0, 255, 255, 255, 255}),
            "the order names point 4294967295 of 2");
  EXPECT_EQ(message({1, 0, 0, 0, 1, 0, 0, 0}), "the order names point 1 twice");
}

}  // namespace
}  // namespace deform
