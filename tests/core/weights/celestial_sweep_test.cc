#include "tests/core/weights/celestial_sweep.h"

#include <gtest/gtest.h>

namespace deform {
namespace {

// The short form of celestial_sweep, which deploy/test --long runs at 10^6
// points a line.
TEST(CelestialSweep, FindsEveryPointExactly) {
  for (const SweepRow& row : SweepCelestial(4000, nullptr)) {
    EXPECT_EQ(BrokenPromise(row), "") << row.configuration << " " << row.scheme;
  }
}

}  // namespace
}  // namespace deform
