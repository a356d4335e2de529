#include "client/load/pose_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/load/frame_judge.h"
#include "client/load/load_model.h"

namespace deform {
namespace {

using Kind = PosePattern::Kind;

Rig CageRig() { return RigOf(MakeLoadModel(100, 80, 0, 0).spec.rig).value(); }
Rig HandleRig() { return RigOf(MakeLoadModel(100, 0, 9, 0).spec.rig).value(); }

std::vector<Kind> AllKinds() {
  return {Kind::kDrag, Kind::kJitter, Kind::kSequence};
}

TEST(PosePattern, SendsPosesThatAServerAccepts) {
  for (const Rig& rig : {CageRig(), HandleRig()}) {
    const Positions rest = RestVertices(rig).topRows(PoseRows(rig));
    for (const Kind kind : AllKinds()) {
      for (const int editors : {1, 3}) {
        const PosePattern pattern(kind, rig, editors, 60, {rest});
        for (int e = 0; e < editors; ++e) {
          EXPECT_TRUE(CheckPoseUpdate(pattern.At(2, e, 7), rig).ok());
        }
      }
    }
  }
}

TEST(PosePattern, GivesEachEditorVerticesOfItsOwn) {
  const Rig rig = CageRig();
  const Positions rest = RestVertices(rig);
  const PosePattern pattern(Kind::kSequence, rig, 4, 60, {rest});
  std::vector<int> owners(rest.rows(), 0);
  for (int e = 0; e < 4; ++e) {
    for (const int32_t v : pattern.At(0, e, 1).vertices) ++owners[v];
  }
  EXPECT_THAT(owners, testing::Each(1));
}

TEST(PosePattern, MergesToWhatAServerMergesInAnyOrder) {
  const Rig rig = HandleRig();
  const Positions rest = RestVertices(rig).topRows(PoseRows(rig));
  for (const Kind kind : AllKinds()) {
    const PosePattern pattern(kind, rig, 2, 60, {rest * 1.1, rest * 0.9});
    // All poses of both, the newest last, and the editors one after the other.
    Pose pose = RestPose(rig);
    for (const int e : {1, 0}) {
      for (uint64_t s = 1; s <= 4; ++s) {
        ApplyPoseUpdate(pattern.At(3, e, s), pose);
      }
    }
    const uint64_t numbers[2] = {4, 4};
    EXPECT_EQ(pattern.Merged(3, numbers).vertices, pose.vertices);
  }
}

TEST(PosePattern, RestsWhereNothingWasSent) {
  const Rig rig = CageRig();
  const PosePattern pattern(Kind::kJitter, rig, 2, 60);
  const uint64_t none[2] = {0, 0};
  EXPECT_EQ(pattern.Merged(0, none).vertices, RestPose(rig).vertices);
}

TEST(PosePattern, DragsOneVertexSmoothly) {
  const Rig rig = CageRig();
  const PosePattern pattern(Kind::kDrag, rig, 1, 60);
  PoseUpdate before = pattern.At(0, 0, 1);
  ASSERT_EQ(before.vertices.size(), 1u);
  for (uint64_t s = 2; s < 200; ++s) {
    const PoseUpdate now = pattern.At(0, 0, s);
    EXPECT_EQ(now.vertices, before.vertices);
    const double step = (now.positions - before.positions).norm();
    EXPECT_GT(step, 0);
    // 2 pi r in two seconds, r = D / 20, and half as much up and down.
    EXPECT_LT(step, 0.01 * DiagonalOf(rig));
    before = now;
  }
}

TEST(PosePattern, JittersWithinAHundredthOfTheRig) {
  const Rig rig = CageRig();
  const PosePattern pattern(Kind::kJitter, rig, 1, 60);
  const Positions one = pattern.At(0, 0, 1).positions;
  const Positions two = pattern.At(0, 0, 2).positions;
  EXPECT_NE(one, two);
  EXPECT_LE((one - RestVertices(rig)).cwiseAbs().maxCoeff(),
            0.01 * DiagonalOf(rig));
}

TEST(PosePattern, SessionsDiffer) {
  const PosePattern pattern(Kind::kJitter, CageRig(), 1, 60);
  EXPECT_NE(pattern.At(0, 0, 1).positions, pattern.At(1, 0, 1).positions);
}

TEST(LoadModel, ModelsOfDifferentNumberDiffer) {
  EXPECT_NE(MakeLoadModel(100, 80, 0, 0).model.positions,
            MakeLoadModel(100, 80, 0, 1).model.positions);
}

TEST(LoadModel, HasAboutWhatWasAskedFor) {
  const LoadModel made = MakeLoadModel(1000, 320, 0, 0);
  EXPECT_EQ(made.model.positions.rows(), 1002);
  EXPECT_EQ(made.spec.rig.faces.rows(), 320);
  EXPECT_EQ(MakeLoadModel(1000, 0, 40, 0).spec.rig.vertices.rows(), 40);
}

}  // namespace
}  // namespace deform
