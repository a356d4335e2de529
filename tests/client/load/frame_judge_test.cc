#include "client/load/frame_judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "client/load/load_model.h"
#include "client/load/pose_pattern.h"
#include "core/deform/deformer.h"
#include "core/weights/binding.h"

namespace deform {
namespace {

// 1e-6 D is what deforming with float weights promises.
constexpr double kTolerance = 1e-6;

// A model, deformed as a server does it.
class Deformed {
 public:
  explicit Deformed(const LoadModel& made) : made_(made) {
    auto mesh = std::make_shared<const Mesh>(
        Mesh::Create(3, made.model.positions, made.model.faces).value());
    binding_ = Bind({.model = mesh,
                     .rig = RigOf(made.spec.rig).value(),
                     .scheme = made.spec.scheme},
                    {})
                   .value();
  }
  Frame FrameOf(const Pose& pose) const {
    Deformer deformer(binding_, nullptr);
    deformer.MoveTo(pose);
    Frame frame;
    frame.origin = {0.25, -0.5, 1};
    frame.positions.resize(3 * binding_->point_count());
    deformer.CopyRelative(0, binding_->point_count(), frame.origin,
                          frame.positions.data());
    return frame;
  }
  FrameJudge Judge() const {
    return FrameJudge::FromModel(made_.model, made_.spec, kTolerance).value();
  }
  const Rig& rig() const { return binding_->rig(); }

 private:
  const LoadModel made_;
  std::shared_ptr<const Binding> binding_;
};

struct JudgeCase {
  std::string name;
  int64_t cage_faces;
  int64_t handles;
};

class FrameJudgeOf : public testing::TestWithParam<JudgeCase> {
 protected:
  const Deformed deformed_{
      MakeLoadModel(300, GetParam().cage_faces, GetParam().handles, 3)};
};

TEST_P(FrameJudgeOf, AcceptsWhatTheDeformerMakesOfEveryPattern) {
  const FrameJudge judge = deformed_.Judge();
  EXPECT_EQ(judge.points(), 252);
  Positions bent =
      RestVertices(deformed_.rig()).topRows(PoseRows(deformed_.rig()));
  bent.col(0) += 0.3 * bent.col(2).cwiseAbs2();
  for (const auto kind : {PosePattern::Kind::kDrag, PosePattern::Kind::kJitter,
                          PosePattern::Kind::kSequence}) {
    const PosePattern pattern(kind, deformed_.rig(), 2, 60, {bent});
    for (const uint64_t number : {1, 2, 50}) {
      const uint64_t numbers[2] = {number, number + 3};
      const Pose pose = pattern.Merged(5, numbers);
      const auto verdict = judge.Judge(deformed_.FrameOf(pose), pose);
      EXPECT_TRUE(verdict.ok) << verdict.error;
      EXPECT_GT(verdict.error, 0);  // Floats are never exact.
    }
  }
}

TEST_P(FrameJudgeOf, FindsTheOneVertexThatIsOff) {
  const FrameJudge judge = deformed_.Judge();
  const Pose rest = RestPose(deformed_.rig());
  const double unit = DiagonalOf(deformed_.rig());
  Frame frame = deformed_.FrameOf(rest);
  frame.positions[3 * 77 + 1] += static_cast<float>(1e-5 * unit);
  const auto verdict = judge.Judge(frame, rest);
  EXPECT_FALSE(verdict.ok);
  EXPECT_EQ(verdict.vertex, 77);
  EXPECT_NEAR(verdict.error, 1e-5, 1e-6);  // Floats of the frame.
}

TEST_P(FrameJudgeOf, RefusesTheFrameOfAnotherPose) {
  const FrameJudge judge = deformed_.Judge();
  const PosePattern pattern(PosePattern::Kind::kDrag, deformed_.rig(), 1, 60);
  const uint64_t first[1] = {10}, second[1] = {11};
  const Frame frame = deformed_.FrameOf(pattern.Merged(0, first));
  EXPECT_TRUE(judge.Judge(frame, pattern.Merged(0, first)).ok);
  EXPECT_FALSE(judge.Judge(frame, pattern.Merged(0, second)).ok);
}

TEST_P(FrameJudgeOf, RefusesNaN) {
  const FrameJudge judge = deformed_.Judge();
  const Pose rest = RestPose(deformed_.rig());
  Frame frame = deformed_.FrameOf(rest);
  frame.positions[30] = std::numeric_limits<float>::quiet_NaN();
  const auto verdict = judge.Judge(frame, rest);
  EXPECT_FALSE(verdict.ok);
  EXPECT_EQ(verdict.vertex, 10);
}

INSTANTIATE_TEST_SUITE_P(Rigs, FrameJudgeOf,
                         testing::ValuesIn<JudgeCase>({{"Icosahedron", 20, 0},
                                                       {"Cage", 80, 0},
                                                       {"Handles", 0, 12}}),
                         [](const auto& test) { return test.param.name; });

TEST(FrameJudge, LooksAllOverALargeModel) {
  // More points than kMaxWeights / columns: runs of them, to the last.
  const LoadModel made = MakeLoadModel(60000, 80, 0, 0);
  const int64_t points = made.model.positions.rows();
  const FrameJudge judge =
      FrameJudge::FromModel(made.model, made.spec, kTolerance).value();
  EXPECT_LT(judge.points(), points);
  EXPECT_GT(judge.points() * 122, FrameJudge::kMaxWeights * 9 / 10);
  const Rig rig = RigOf(made.spec.rig).value();
  const Pose rest = RestPose(rig);
  Frame frame;
  frame.positions.resize(3 * points);
  for (int64_t i = 0; i < points; ++i) {
    for (int k = 0; k < 3; ++k) {
      frame.positions[3 * i + k] =
          static_cast<float>(made.model.positions(i, k));
    }
  }
  EXPECT_TRUE(judge.Judge(frame, rest).ok);
  for (const int64_t vertex : {int64_t{0}, points - 1}) {
    Frame wrong = frame;
    wrong.positions[3 * vertex] += 1;
    EXPECT_EQ(judge.Judge(wrong, rest).vertex, vertex);
  }
}

}  // namespace
}  // namespace deform
