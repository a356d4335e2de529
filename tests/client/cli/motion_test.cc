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

// With a handle off the axis, in the middle.
Positions BarWithHandle() {
  Positions handles(9, 3);
  handles << Bar(), 5.8, 0.5, 1.9;
  return handles;
}

TEST(Motion, BeginsAndEndsAtRestAndMovesBetween) {
  for (const std::string& name : MotionNames()) {
    const Positions rest = BarWithHandle();
    for (const double time : {0.0, 1.0}) {
      const Positions pose = PoseOfMotion(name, rest, 3, time).value();
      EXPECT_LT((pose - rest).cwiseAbs().maxCoeff(), 1e-9) << name;
    }
    const Positions pose = PoseOfMotion(name, rest, 3, 0.4).value();
    EXPECT_GT((pose - rest).cwiseAbs().maxCoeff(), 0.02) << name;
    EXPECT_TRUE(pose.allFinite()) << name;
  }
}

TEST(Motion, AnOrganMovesWithinAFixedBox) {
  for (const char* name : {"beat", "wave"}) {
    for (double time = 0; time < 1; time += 0.1) {
      const Positions pose =
          PoseOfMotion(name, BarWithHandle(), 3, time).value();
      EXPECT_EQ(pose.topRows(8), Bar()) << name;
    }
  }
}

TEST(Motion, AWaveContractsOnePlaceAfterTheOther) {
  Positions handles(11, 3);
  handles << Bar(), 5.8, 0.5, 1, 5.8, 0.5, 2, 5.8, 0.5, 3;
  int before = -1;
  for (const double time : {0.36, 0.5, 0.64}) {
    const Positions pose = PoseOfMotion("wave", handles, 3, time).value();
    Eigen::Index most = 0;
    pose.bottomRows(3).col(0).minCoeff(&most);
    EXPECT_GT(most, before);
    before = static_cast<int>(most);
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
  Positions square(5, 3);
  square << 0, 0, 0, 3, 0, 0, 3, 1, 0, 0, 1, 0, 0.8, 0.9, 0;
  for (const char* name : {"bend", "stretch", "pulse", "beat", "wave"}) {
    const Positions pose = PoseOfMotion(name, square, 2, 0.3).value();
    EXPECT_TRUE((pose.col(2).array() == 0).all()) << name;
    EXPECT_GT((pose - square).cwiseAbs().maxCoeff(), 0.01) << name;
  }
  EXPECT_THAT(
      std::string(PoseOfMotion("twist", square, 2, 0.2).status().message()),
      HasSubstr("cannot be twisted"));
}

TEST(Motion, KnowsWhichThereAre) {
  EXPECT_THAT(std::string(PoseOfMotion("jump", Bar(), 3, 0).status().message()),
              HasSubstr("'jump': twist, bend, stretch, pulse, beat or wave"));
}

TEST(Motion, APointStays) {
  const Positions point = Positions::Constant(1, 3, 2.0);
  for (const std::string& name : MotionNames()) {
    EXPECT_TRUE(PoseOfMotion(name, point, 3, 0.3)->allFinite()) << name;
  }
}

}  // namespace
}  // namespace deform::cli
