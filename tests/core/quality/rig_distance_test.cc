#include "core/quality/rig_distance.h"

#include <gtest/gtest.h>

#include "tests/core/quality/posed.h"

namespace deform {
namespace {

constexpr double kFar = 1e300;

TEST(RigDistance, IsThatToTheCage) {
  const RigDistance distance(CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})));
  EXPECT_EQ(distance.ToBoundary({0, 0, 0}, kFar), 1);
  EXPECT_EQ(distance.ToBoundary({0.75, 0, 0}, kFar), 0.25);
  EXPECT_EQ(distance.ToBoundary({3, 0, 0}, kFar), 2);
  EXPECT_EQ(distance.ToSingularity({0.75, 0, 0}), 0.25);
  // Beyond what is asked for the answer is only not smaller.
  EXPECT_GE(distance.ToBoundary({0, 0, 0}, 0.5), 0.5);
}

TEST(RigDistance, IsThatToTheHullAndTheNearestHandle) {
  Positions handles(9, 3);
  handles << Cuboid({-1, -1, -1}, {1, 1, 1}).positions, 0.5, 0, 0;
  const RigDistance distance(Handles::Create(3, handles).value());
  EXPECT_NEAR(distance.ToBoundary({0.25, 0, 0}, kFar), 0.75, 1e-15);
  EXPECT_NEAR(distance.ToSingularity({0.25, 0, 0}), 0.25, 1e-15);
  EXPECT_NEAR(distance.ToSingularity({-0.9, 0, 0}), 0.1, 1e-15);
}

TEST(RigDistance, OfABindingIsTheSmallestOfAllItsPoints) {
  Shape model{Positions(5000, 3), Faces(0, 3)};
  for (int i = 0; i < 5000; ++i) {
    model.positions.row(i) << 0.9 * i / 5000, 0.1, -0.1;
  }
  model.positions.row(4321) << 0.98, 0.1, 0.2;
  model.positions.row(7) << 5, 5, 5;  // Not bound, and so not counted.
  const Shape cube = Cuboid({-1, -1, -1}, {1, 1, 1});
  ThreadPool pool({.threads = 3});
  for (const char* scheme : {"green", "s_cc"}) {
    const auto binding = BindTo(scheme, model, RigFor(scheme, cube));
    EXPECT_EQ(binding->unbound_count(), 1);
    for (ThreadPool* threads : {static_cast<ThreadPool*>(nullptr), &pool}) {
      EXPECT_NEAR(*SmallestDistance(*binding, threads, nullptr), 0.02, 1e-14);
    }
  }
}

TEST(RigDistance, OfABindingWithoutWeightsIsZero) {
  Shape model{Positions(1, 3), Faces(0, 3)};
  model.positions << 5, 5, 5;
  const auto binding =
      BindTo("green", model, CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})));
  EXPECT_EQ(*SmallestDistance(*binding, nullptr, nullptr), 0);
}

}  // namespace
}  // namespace deform
