#include "core/weights/bind_quality.h"

#include <gtest/gtest.h>

#include <memory>

#include "core/weights/binding.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

BindQuality Row(double least, double most) {
  return {.reproduction_error = 1e-7 * most,
          .partition_error = 1e-8 * most,
          .weight_min = least,
          .weight_max = most,
          .weight_sum_max = most - least};
}

TEST(QualityTally, IsZeroWithoutPoints) {
  const BindQuality quality = QualityTally().quality();
  EXPECT_EQ(quality.weight_min, 0);
  EXPECT_EQ(quality.weight_max, 0);
  EXPECT_EQ(quality.iterations_mean, 0);
  EXPECT_EQ(quality.residual_mean, 0);
}

TEST(QualityTally, KeepsTheWorstOfAllRows) {
  QualityTally tally;
  tally.AddRow(Row(0.25, 0.5));
  tally.AddRow(Row(-0.5, 0.75));
  tally.AddRow(Row(0, 1));
  const BindQuality quality = tally.quality();
  EXPECT_EQ(quality.reproduction_error, 1e-7);
  EXPECT_EQ(quality.partition_error, 1e-8);
  EXPECT_EQ(quality.weight_min, -0.5);
  EXPECT_EQ(quality.weight_max, 1);
  EXPECT_EQ(quality.weight_sum_max, 1.25);
}

TEST(QualityTally, AveragesSearchesOverThePointsThatNeededOne) {
  QualityTally tally;
  tally.AddRow(Row(0, 1));
  tally.AddSearch(4, 1e-16);
  tally.AddSearch(8, 3e-16);
  const BindQuality quality = tally.quality();
  EXPECT_EQ(quality.iterations_total, 12);
  EXPECT_EQ(quality.iterations_max, 8);
  EXPECT_EQ(quality.iterations_mean, 6);
  EXPECT_EQ(quality.residual_max, 3e-16);
  EXPECT_DOUBLE_EQ(quality.residual_mean, 2e-16);
}

TEST(QualityTally, MergesInAnyOrder) {
  QualityTally positive, negative, none;
  positive.AddRow(Row(0.2, 0.5));
  negative.AddRow(Row(-1, 1));
  for (const bool turned : {false, true}) {
    QualityTally all;
    for (const QualityTally* tally : {&none, turned ? &positive : &negative,
                                      turned ? &negative : &positive, &none}) {
      all.Merge(*tally);
    }
    EXPECT_EQ(all.quality().weight_min, -1);
    EXPECT_EQ(all.quality().weight_max, 1);
  }
  // No weight of 0 comes in from where there are no points.
  positive.Merge(none);
  EXPECT_EQ(positive.quality().weight_min, 0.2);
}

BindQuality QualityOf(const char* scheme, const Shape& model, Rig rig) {
  return (*Bind({.model = std::make_shared<const Mesh>(MeshOf(model)),
                 .rig = std::move(rig),
                 .scheme = scheme},
                {}))
      ->quality();
}

TEST(QualityOfABinding, TellsHowTheSolverCameOut) {
  const Positions corners = Cuboid({-1, -1, -1}, {1, 1, 1}).positions;
  for (const char* scheme : {"s_cc", "t_cc"}) {
    SCOPED_TRACE(scheme);
    const BindQuality quality = QualityOf(scheme, Icosphere(0.9, 3),
                                          Handles::Create(3, corners).value());
    EXPECT_GE(quality.iterations_total, 642);
    EXPECT_GE(quality.iterations_max, quality.iterations_mean);
    EXPECT_GT(quality.residual_max, 0);
    EXPECT_LE(quality.residual_mean, quality.residual_max);
    // What the lane solver calls solved; the plain one stops at 1e-15.
    EXPECT_LE(quality.residual_max, 1e-14);
    EXPECT_GT(quality.weight_min, 0);
    EXPECT_LT(quality.weight_max, 1);
    // Float weights.
    EXPECT_LT(quality.partition_error, 1e-6);
  }
}

TEST(QualityOfABinding, TellsOfWeightsBelowZero) {
  // Green coordinates of a convex cage are not negative.
  const BindQuality green =
      QualityOf("green", Torus(2, 0.3, 24, 8), CageOf(Torus(2, 0.7, 12, 5)));
  EXPECT_LT(green.weight_min, 0);
  EXPECT_GT(green.weight_max, 0.1);
  EXPECT_GT(green.partition_error, 0);
  EXPECT_LT(green.partition_error, 1e-6);
  EXPECT_EQ(green.iterations_total, 0);
  EXPECT_EQ(green.residual_max, 0);
}

}  // namespace
}  // namespace deform
