#include "core/deform/pose.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "core/base/error.h"
#include "tests/core/deform/test_cages.h"

namespace deform {
namespace {

struct BadUpdate {
  std::string name;
  std::function<void(PoseUpdate&)> damage;
  std::string reason;
  std::string message;
};

class PoseRejects : public testing::TestWithParam<BadUpdate> {};

TEST_P(PoseRejects, WithAMessageThatSaysWhatToMend) {
  const Rig rig = BoxCage();
  PoseUpdate update{.vertices = {1, 3}, .positions = Positions::Ones(2, 3)};
  ASSERT_TRUE(CheckPoseUpdate(update, rig).ok());
  GetParam().damage(update);
  const absl::Status status = CheckPoseUpdate(update, rig);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_EQ(status.message(), GetParam().message);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    Pose, PoseRejects,
    testing::ValuesIn<BadUpdate>({
        {"FewerPositionsThanNames",
         [](PoseUpdate& u) { u.positions.conservativeResize(1, 3); },
         "WRONG_LENGTH", "pose has 1 positions, but names 2 vertices"},
        {"FullPoseOfAnotherRig", [](PoseUpdate& u) { u.vertices.clear(); },
         "WRONG_LENGTH", "pose has 2 positions, but the rig has 8 vertices"},
        {"Nothing", [](PoseUpdate& u) { u = PoseUpdate{}; }, "WRONG_LENGTH",
         "pose has 0 positions, but the rig has 8 vertices"},
        {"VertexOutOfRange", [](PoseUpdate& u) { u.vertices[1] = 8; },
         "INDEX_OUT_OF_RANGE", "pose entry 1 refers to vertex 8 of 8"},
        {"NegativeVertex", [](PoseUpdate& u) { u.vertices[0] = -1; },
         "INDEX_OUT_OF_RANGE", "pose entry 0 refers to vertex -1 of 8"},
        {"NotANumber", [](PoseUpdate& u) { u.positions(1, 2) = kNan; },
         "NON_FINITE", "pose entry 1 has a coordinate that is not finite"},
        {"TooLarge", [](PoseUpdate& u) { u.positions(0, 0) = 1e101; },
         "COORDINATE_TOO_LARGE", "pose entry 0 has a coordinate beyond 1e+100"},
        {"BlendAboveOne", [](PoseUpdate& u) { u.stretch_blend = 1.5; },
         "STRETCH_BLEND_OUT_OF_RANGE",
         "stretch blend must be in [0, 1], not 1.5"},
        {"BlendNotANumber", [](PoseUpdate& u) { u.stretch_blend = kNan; },
         "STRETCH_BLEND_OUT_OF_RANGE",
         "stretch blend must be in [0, 1], not nan"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(Pose, OfAPlaneStaysInThePlane) {
  const Rig rig = SquareCage();
  PoseUpdate update{.vertices = {0}, .positions = Positions::Ones(1, 3)};
  EXPECT_EQ(CheckPoseUpdate(update, rig).message(),
            "a 2D pose must lie in the plane z = 0");
}

TEST(Pose, MergesByVertexAndTheLastPlaceWins) {
  Pose pose = RestPose(Rig(BoxCage()));
  const Positions rest = pose.vertices;
  Positions places(3, 3);
  places << 1, 1, 1, 2, 2, 2, 3, 3, 3;
  ApplyPoseUpdate({.vertices = {4, 0, 4}, .positions = places}, pose);
  EXPECT_EQ(pose.vertices.row(0), places.row(1));
  EXPECT_EQ(pose.vertices.row(4), places.row(2));
  EXPECT_EQ(pose.vertices.row(1), rest.row(1));
}

// Two handles among the corners of a cube, which are fixed.
Rig TwoFreeHandles() {
  Positions free(2, 3);
  free << 0, 0, 0, 0.5, 0, 0;
  return Handles::Create(3, free, BoxCage().vertices()).value();
}

TEST(Pose, OfFixedHandlesIsRefused) {
  const PoseUpdate update{.vertices = {1, 2},
                          .positions = Positions::Ones(2, 3)};
  const absl::Status status = CheckPoseUpdate(update, TwoFreeHandles());
  EXPECT_EQ(DetailOf(status).reason, "FIXED_HANDLE");
  EXPECT_EQ(DetailOf(status).field, "pose.vertices");
  EXPECT_EQ(status.message(),
            "pose entry 1 moves handle 2, which is fixed, as all from 2 on");
  const PoseUpdate beyond{.vertices = {10}, .positions = Positions::Ones(1, 3)};
  EXPECT_EQ(CheckPoseUpdate(beyond, TwoFreeHandles()).message(),
            "pose entry 0 refers to vertex 10 of 2");
}

TEST(Pose, IsFullWithoutTheFixedHandles) {
  const Rig rig = TwoFreeHandles();
  const PoseUpdate all{.positions = Positions::Ones(2, 3)};
  ASSERT_TRUE(CheckPoseUpdate(all, rig).ok());
  Pose pose = RestPose(rig);
  ApplyPoseUpdate(all, pose);
  EXPECT_EQ(pose.vertices.topRows(2), Positions::Ones(2, 3));
  EXPECT_EQ(pose.vertices.bottomRows(8), BoxCage().vertices());
  EXPECT_EQ(
      CheckPoseUpdate({.positions = Positions::Ones(10, 3)}, rig).message(),
      "pose has 10 positions, but the rig has 2 vertices");
}

TEST(Pose, KeepsTheBlendUntilItIsChanged) {
  Pose pose = RestPose(Rig(BoxCage()));
  EXPECT_EQ(pose.stretch_blend, 1);
  const PoseUpdate blend{.stretch_blend = 0.25};
  ASSERT_TRUE(CheckPoseUpdate(blend, Rig(BoxCage())).ok());
  ApplyPoseUpdate(blend, pose);
  ApplyPoseUpdate({.vertices = {0}, .positions = Positions::Ones(1, 3)}, pose);
  EXPECT_EQ(pose.stretch_blend, 0.25);
  EXPECT_EQ(pose.vertices.rows(), 8);
}

}  // namespace
}  // namespace deform
