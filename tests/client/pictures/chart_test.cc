#include "client/pictures/chart.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace deform {
namespace {

bool IsRed(Color c) { return c.r > c.g + 60 && c.r > c.b + 60; }
bool IsInk(Color c) { return c.r < 120 && c.g < 120 && c.b < 130; }

int Count(const Image& image, bool (*is)(Color), int left, int right) {
  int count = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = left; x < right; ++x) count += is(image.at(x, y));
  }
  return count;
}

Chart Empty() {
  Chart chart;
  chart.width = 400;
  chart.height = 200;
  return chart;
}

const Light kRed(0.9f, 0.1f, 0.1f);

TEST(Chart, HasTheSizeThatWasAskedFor) {
  const Image image = DrawChart(Empty());
  EXPECT_EQ(image.width, 400);
  EXPECT_EQ(image.height, 200);
  EXPECT_GT(Count(image, IsInk, 0, 400), 200);  // Axes and numbers.
}

TEST(Chart, DrawsBarsAsHighAsTheyAre) {
  Chart chart = Empty();
  chart.bars = {{0, 0.5, 1, kRed}, {0.5, 1, 0.25, kRed}};
  const Image image = DrawChart(chart);
  const int low = Count(image, IsRed, 240, 370);
  const int high = Count(image, IsRed, 90, 220);
  EXPECT_GT(low, 500);
  EXPECT_NEAR(static_cast<double>(high) / low, 4, 0.4);
}

TEST(Chart, DrawsCurvesWithinItsAxesAndLeavesGaps) {
  Chart chart = Empty();
  Curve curve{.color = kRed};
  for (int i = 0; i <= 100; ++i) {
    curve.x.push_back(i / 100.0);
    curve.y.push_back(i > 40 && i < 60 ? std::nan("") : 0.5);
  }
  curve.x.push_back(0.5);
  curve.y.push_back(1e9);
  chart.curves = {curve};
  const Image image = DrawChart(chart);
  EXPECT_GT(Count(image, IsRed, 90, 180), 150);
  EXPECT_EQ(Count(image, IsRed, 220, 235), 0);
  EXPECT_GT(Count(image, IsRed, 290, 370), 150);
}

TEST(Chart, PutsPowersOfTenAtEqualSteps) {
  Chart chart = Empty();
  chart.x = {.logarithmic = true, .low = 1, .high = 100};
  chart.bars = {{1, 10, 1, kRed}};
  const Image image = DrawChart(chart);
  const int left = Count(image, IsRed, 0, 227);
  const int right = Count(image, IsRed, 229, 400);
  EXPECT_GT(left, 5000);
  EXPECT_LT(right, left / 50);
}

TEST(Chart, NamesCurvesInALegend) {
  Chart chart = Empty();
  Curve curve{.name = "curve", .color = kRed, .x = {0.1}, .y = {0.1}};
  chart.curves = {curve};
  EXPECT_GT(Count(DrawChart(chart), IsRed, 250, 400), 20);
}

TEST(Scale, RunsFromItsLowestColourToItsHighest) {
  const Image image = DrawScale({.low = 0, .high = 1, .title = "t"}, 400, 84);
  const Light left = ToLight(image.at(84, 46));
  const Light right = ToLight(image.at(334, 46));
  EXPECT_LT((left - ColorAt(ColorMap::kSequential, 0)).norm(), 0.1f);
  EXPECT_LT((right - ColorAt(ColorMap::kSequential, 1)).norm(), 0.1f);
}

TEST(Layout, PutsImagesBesideAndBelowEachOther) {
  Image a{2, 1, {{1, 0, 0}, {2, 0, 0}}};
  Image b{1, 2, {{3, 0, 0}, {4, 0, 0}}};
  const Image row = Beside({a, b});
  EXPECT_EQ(row.width, 3);
  EXPECT_EQ(row.height, 2);
  EXPECT_EQ(row.at(1, 0).r, 2);
  EXPECT_EQ(row.at(2, 1).r, 4);
  EXPECT_GT(row.at(0, 1).r, 240);  // Ground.
  const Image column = Stacked({a, b});
  EXPECT_EQ(column.width, 2);
  EXPECT_EQ(column.height, 3);
  EXPECT_EQ(column.at(0, 2).r, 4);
  EXPECT_GT(column.at(1, 2).r, 240);
}

}  // namespace
}  // namespace deform
