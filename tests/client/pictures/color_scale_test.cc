#include "client/pictures/color_scale.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace deform {
namespace {

using testing::ElementsAre;

// As the eye weighs them.
float Brightness(const Light& light) {
  return light.dot(Light(0.2126f, 0.7152f, 0.0722f));
}

TEST(ColorMaps, GrowBrighterFromLowToHigh) {
  float before = -1;
  for (int k = 0; k <= 50; ++k) {
    const float now = Brightness(ColorAt(ColorMap::kSequential, k / 50.0));
    EXPECT_GT(now, before) << k;
    before = now;
  }
}

TEST(ColorMaps, DivergeFromALightMiddle) {
  const Light low = ColorAt(ColorMap::kDiverging, 0);
  const Light middle = ColorAt(ColorMap::kDiverging, 0.5);
  const Light high = ColorAt(ColorMap::kDiverging, 1);
  EXPECT_GT(Brightness(middle), Brightness(low) + 0.3f);
  EXPECT_GT(Brightness(middle), Brightness(high) + 0.3f);
  EXPECT_GT(low.z(), low.x());
  EXPECT_GT(high.x(), high.z());
}

TEST(ColorMaps, EndWhereTheirRangeEnds) {
  for (const ColorMap map : {ColorMap::kSequential, ColorMap::kDiverging}) {
    EXPECT_EQ(ColorAt(map, -3), ColorAt(map, 0));
    EXPECT_EQ(ColorAt(map, 7), ColorAt(map, 1));
  }
}

TEST(ColorScale, PlacesValuesBetweenItsEnds) {
  const ColorScale even{.low = 2, .high = 4};
  EXPECT_EQ(even.PlaceOf(3), 0.5);
  EXPECT_EQ(even.PlaceOf(-1), 0);
  EXPECT_EQ(even.PlaceOf(9), 1);
  EXPECT_TRUE(std::isnan(even.PlaceOf(std::nan(""))));
  const ColorScale powers{.low = 1, .high = 100, .logarithmic = true};
  EXPECT_DOUBLE_EQ(powers.PlaceOf(10), 0.5);
  EXPECT_EQ(powers.PlaceOf(-5), 0);
}

TEST(Ticks, AreRoundAndWithin) {
  EXPECT_THAT(RoundTicks(0, 1, false, 5),
              ElementsAre(0, testing::DoubleEq(0.5), 1));
  EXPECT_THAT(RoundTicks(1, 1000, true, 5), ElementsAre(1, 10, 100, 1000));
  EXPECT_THAT(RoundTicks(1, 12, true, 5), ElementsAre(1, 2, 5, 10));
  EXPECT_THAT(RoundTicks(1, 1.7, true, 4),
              ElementsAre(1, testing::DoubleEq(1.2), testing::DoubleEq(1.4),
                          testing::DoubleEq(1.6)));
  EXPECT_LE(RoundTicks(1, 1e12, true, 5).size(), 7u);
  for (const double high : {0.03, 0.7, 1.0, 3.4, 18.0, 950.0}) {
    const auto ticks = RoundTicks(0, high, false, 6);
    EXPECT_GE(ticks.size(), 2u) << high;
    EXPECT_LE(ticks.size(), 8u) << high;
    EXPECT_LE(ticks.back(), high * (1 + 1e-9));
  }
}

TEST(Numbers, AreShort) {
  EXPECT_EQ(NumberText(0), "0");
  EXPECT_EQ(NumberText(0.25), "0.25");
  EXPECT_EQ(NumberText(3000), "3000");
  EXPECT_EQ(NumberText(-2.5), "-2.5");
  EXPECT_EQ(NumberText(1e-6), "1e-6");
  EXPECT_EQ(NumberText(2e12), "2e12");
}

}  // namespace
}  // namespace deform
