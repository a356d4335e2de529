#include "client/pictures/font.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <tuple>

namespace deform {
namespace {

std::set<std::tuple<double, double, double, double>> Shape(char c) {
  std::set<std::tuple<double, double, double, double>> shape;
  for (const Stroke& s : TextStrokes(absl::string_view(&c, 1))) {
    shape.insert({s.x0, s.y0, s.x1, s.y1});
  }
  return shape;
}

TEST(Font, EveryCharacterLooksDifferent) {
  std::set<std::set<std::tuple<double, double, double, double>>> shapes;
  for (char c = ' '; c <= '~'; ++c) {
    EXPECT_TRUE(shapes.insert(Shape(c)).second) << c;
  }
}

TEST(Font, LettersStandSideBySide) {
  for (const Stroke& s : TextStrokes(" A")) EXPECT_GE(s.x0, kFontAdvance);
  EXPECT_TRUE(TextStrokes(" ").empty());
}

TEST(Font, WhatItDoesNotHaveIsAQuestionMark) {
  EXPECT_EQ(Shape('\xc3'), Shape('?'));
  EXPECT_EQ(Shape('\n'), Shape('?'));
}

}  // namespace
}  // namespace deform
