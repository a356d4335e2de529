// Poses in, frames out, over a real connection.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "core/base/error.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;

// Float weights and float frames, in units of D of the cube.
constexpr double kFrameTolerance = 1e-6 * 3.5;

PoseUpdate MovedBy(const Vec3& offset) {
  Positions vertices = Cube().vertices();
  vertices.rowwise() += offset.transpose();
  return {.positions = vertices};
}

void ExpectBallAt(const Frame& frame, const Vec3& offset) {
  Positions expected = Ball().positions();
  expected.rowwise() += offset.transpose();
  EXPECT_LT((frame.DoublePositions() - expected).cwiseAbs().maxCoeff(),
            kFrameTolerance);
}

TEST(Deform, ShowsTheRestPoseAtJoining) {
  RunningServer server;
  auto stream = server.client().Deform(server.BallSession()).value();
  EXPECT_EQ(stream.joined().point_count, Ball().size());
  EXPECT_EQ(stream.joined().pose.vertices, Cube().vertices());
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.revision, 0u);
  EXPECT_EQ(frame.answers_sequence, 0u);
  ExpectBallAt(frame, Vec3::Zero());
}

TEST(Deform, AnswersAPoseWithTheDeformedModel) {
  RunningServer server;
  auto stream = server.client().Deform(server.BallSession()).value();
  const uint64_t sequence = stream.Send(MovedBy({3, -2, 1})).value();
  Frame frame;
  do {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
  } while (frame.answers_sequence < sequence);
  EXPECT_EQ(frame.revision, 1u);
  ExpectBallAt(frame, {3, -2, 1});
}

TEST(Deform, EveryPoseGetsItsFrameInOrder) {
  constexpr int kPoses = 1000;
  RunningServer server;
  auto stream =
      server.client().Deform(server.BallSession(), Delivery::kEvery).value();
  std::thread sender([&] {
    for (int i = 1; i <= kPoses; ++i) {
      ASSERT_TRUE(stream.Send(MovedBy({0.01 * i, 0, 0})).ok());
    }
    stream.Close();
  });
  Frame frame;
  for (uint64_t i = 0; i <= kPoses; ++i) {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
    ASSERT_EQ(frame.revision, i);
    ASSERT_EQ(frame.answers_sequence, i);
    ASSERT_EQ(frame.skipped_revisions, 0u);
    ExpectBallAt(frame, {0.01 * static_cast<double>(i), 0, 0});
  }
  EXPECT_EQ(stream.NextFrame(frame).code(), absl::StatusCode::kOutOfRange);
  sender.join();
}

}  // namespace
}  // namespace deform
