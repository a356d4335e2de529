#include "client/cli/motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace deform::cli {
namespace {

using testing::HasSubstr;

Positions Bar() {
  Positions corners(8, 3);
  for (int i = 0; i < 8; ++i) {
    corners.row(i) << 5 + (i & 1), (i >> 1 & 1), 4 * (i >> 2);
  }
  return corners;
}

TEST(Motion, BeginsAndEndsAtRestAndMovesBetween) {
  for (const char* name : MotionNames()) {
    for (const double time : {0.0, 1.0}) {
      const Positions pose = PoseOfMotion(name, Bar(), 3, time).value();
      EXPECT_LT((pose - Bar()).cwiseAbs().maxCoeff(), 1e-9) << name;
    }
    const Positions pose = PoseOfMotion(name, Bar(), 3, 0.25).value();
    EXPECT_GT((pose - Bar()).cwiseAbs().maxCoeff(), 0.05) << name;
    EXPECT_TRUE(pose.allFinite()) << name;
  }
}

TEST(Motion, TwistTurnsTheEndsAgainstEachOther) {
  const Positions pose = PoseOfMotion("twist", Bar(), 3, 0.25).value();
  // A quarter turn at the upper end, backwards at the lower.
  EXPECT_NEAR(pose.row(0).head<2>().norm(), Bar().row(2).head<2>().norm(), 2);
  EXPECT_NEAR(pose(4, 2), 4, 1e-12);
  EXPECT_LT((pose.row(4).head<2>() - Bar().row(5).head<2>()).norm(), 1e-9);
  EXPECT_LT((pose.row(0).head<2>() - Bar().row(2).head<2>()).norm(), 1e-9);
}

TEST(Motion, AFlatRigStaysFlat) {
  Positions square(4, 3);
  square << 0, 0, 0, 3, 0, 0, 3, 1, 0, 0, 1, 0;
  for (const char* name : {"bend", "stretch", "pulse"}) {
    const Positions pose = PoseOfMotion(name, square, 2, 0.2).value();
    EXPECT_TRUE((pose.col(2).array() == 0).all()) << name;
    EXPECT_GT((pose - square).cwiseAbs().maxCoeff(), 0.01) << name;
  }
  EXPECT_THAT(
      std::string(PoseOfMotion("twist", square, 2, 0.2).status().message()),
      HasSubstr("cannot be twisted"));
}

TEST(Motion, KnowsWhichThereAre) {
  EXPECT_THAT(std::string(PoseOfMotion("jump", Bar(), 3, 0).status().message()),
              HasSubstr("'jump': twist, bend, stretch or pulse"));
}

TEST(Motion, APointStays) {
  const Positions point = Positions::Constant(1, 3, 2.0);
  for (const char* name : MotionNames()) {
    EXPECT_TRUE(PoseOfMotion(name, point, 3, 0.3)->allFinite()) << name;
  }
}

}  // namespace
}  // namespace deform::cli
