// The client library against a live server: what its headers promise.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "core/base/error.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

Positions Moved(Positions positions, double x) {
  positions.col(0).array() += x;
  return positions;
}

TEST(ClientLibrary, DeformsInAFewLines) {
  RunningServer running;
  auto client = Client::Connect(running.address()).value();
  auto model = client.RegisterModel(Ball(), "ball").value();
  auto binding =
      client.CreateBinding({.model_id = model.model_id, .rig = Cube()}).value();
  auto session = client.CreateSession(binding.binding_id).value();
  auto stream = client.Deform(session.session_id).value();
  const uint64_t sent =
      stream.Send({.positions = Moved(Cube().vertices(), 3)}).value();
  Frame frame;
  do {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
  } while (frame.answers_sequence < sent);
  // A translation is exact but for the float on the wire.
  EXPECT_LT((frame.DoublePositions() - Moved(Ball().positions(), 3))
                .cwiseAbs()
                .maxCoeff(),
            1e-6);
}

TEST(ClientLibrary, TheFirstFrameShowsTheSessionAtJoining) {
  RunningServer running;
  auto stream = running.client().Deform(running.BallSession()).value();
  EXPECT_EQ(stream.joined().vertex_count, 8);
  EXPECT_EQ(stream.joined().point_count, 162);
  EXPECT_EQ(stream.joined().pose.vertices, Cube().vertices());
  EXPECT_EQ(stream.joined().pose.stretch_blend, 1);
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.answers_sequence, 0u);
  EXPECT_LT(
      (frame.DoublePositions() - Ball().positions()).cwiseAbs().maxCoeff(),
      1e-6);
}

TEST(ClientLibrary, ARefusedPoseLeavesTheStreamOpen) {
  RunningServer running;
  auto stream =
      running.client().Deform(running.BallSession(), Delivery::kEvery).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  const uint64_t bad =
      stream.Send({.positions = Positions::Zero(3, 3)}).value();
  const absl::Status refused = stream.NextFrame(frame);
  EXPECT_EQ(DetailOf(refused).reason, "WRONG_LENGTH");
  EXPECT_EQ(stream.rejected_sequence(), bad);
  EXPECT_FALSE(stream.ended());
  const uint64_t good =
      stream.Send({.positions = Moved(Cube().vertices(), 1)}).value();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.answers_sequence, good);
}

TEST(ClientLibrary, CloseDrainsAndMayBeCalledAgain) {
  RunningServer running;
  auto stream =
      running.client().Deform(running.BallSession(), Delivery::kEvery).value();
  ASSERT_TRUE(stream.Send({.positions = Moved(Cube().vertices(), 1)}).ok());
  stream.Close();
  stream.Close();
  EXPECT_TRUE(absl::IsFailedPrecondition(
      stream.Send({.positions = Cube().vertices()}).status()));
  Frame frame;
  absl::Status status;
  uint64_t answered = 0;
  while ((status = stream.NextFrame(frame)).ok()) {
    answered = frame.answers_sequence;
  }
  EXPECT_TRUE(absl::IsOutOfRange(status)) << status;
  EXPECT_TRUE(stream.ended());
  EXPECT_EQ(answered, 1u);
  EXPECT_TRUE(absl::IsOutOfRange(stream.NextFrame(frame))) << "and stays so";
}

TEST(ClientLibrary, CancelWakesAReceiver) {
  RunningServer running;
  auto stream = running.client().Deform(running.BallSession()).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  std::thread other([&] { stream.Cancel(); });
  const absl::Status status = stream.NextFrame(frame);
  other.join();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_TRUE(stream.ended());
}

TEST(ClientLibrary, ADeletedSessionEndsItsStreams) {
  RunningServer running;
  const std::string session = running.BallSession();
  auto stream = running.client().Deform(session).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  ASSERT_TRUE(running.client().DeleteSession(session).ok());
  const absl::Status status = stream.NextFrame(frame);
  EXPECT_EQ(DetailOf(status).reason, "SESSION_DELETED") << status;
  EXPECT_TRUE(stream.ended());
}

TEST(ClientLibrary, ErrorsNameReasonFieldAndResource) {
  RunningServer running;
  const absl::Status missing = running.client().GetModel("none").status();
  EXPECT_TRUE(absl::IsNotFound(missing)) << missing;
  EXPECT_EQ(DetailOf(missing).reason, "MODEL_NOT_FOUND");
  EXPECT_EQ(DetailOf(missing).resource_type, "model");
  EXPECT_EQ(DetailOf(missing).resource_name, "none");
  RigArrays open = Cube();
  open.faces.conservativeResize(11, 3);
  const ModelInfo model = running.client().RegisterModel(Ball(), "").value();
  const absl::Status refused =
      running.client()
          .CreateBinding({.model_id = model.model_id, .rig = open})
          .status();
  EXPECT_EQ(DetailOf(refused).reason, "CAGE_NOT_CLOSED");
  EXPECT_EQ(DetailOf(refused).field, "rig.cage.corners");
}

TEST(ClientLibrary, AnUploadCanBeGivenUp) {
  RunningServer running;
  const Mesh large = MeshOf(Icosphere(0.5, 6));  // Two chunks.
  int calls = 0;
  const absl::Status status =
      running.client()
          .RegisterModel(large, "large",
                         [&](int64_t, int64_t) { return ++calls > 1; })
          .status();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_EQ(calls, 1);
  EXPECT_THAT(*running.client().ListModels(), IsEmpty());
}

TEST(ClientLibrary, ABindingCanBeGivenUp) {
  RunningServer running;
  const Mesh large = MeshOf(Icosphere(0.5, 6));
  const ModelInfo model = running.client().RegisterModel(large, "").value();
  const absl::Status status =
      running.client()
          .CreateBinding(
              {.model_id = model.model_id, .rig = CageOf(Icosphere(1, 3))},
              [](int64_t, int64_t) { return false; })
          .status();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  EXPECT_THAT(*running.client().ListBindings(), IsEmpty());
}

TEST(ClientLibrary, ListsHoldEveryPage) {
  RunningServer running;
  // Pages hold a hundred.
  for (int i = 0; i < 203; ++i) {
    const Positions point = Positions::Constant(1, 3, i);
    ASSERT_TRUE(running.client().RegisterModel({3, point, Faces()}, "").ok());
  }
  EXPECT_THAT(*running.client().ListModels(), SizeIs(203));
}

TEST(ClientLibrary, WeightsComeInRangesUntilTheCallerHasEnough) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  int64_t next = 100;
  ASSERT_TRUE(running.client()
                  .GetWeights(binding.binding_id,
                              WeightPrecision::kRecomputedFloat64, 100, 50,
                              [&](const WeightRows& rows) {
                                EXPECT_EQ(rows.first_point, next);
                                next += rows.vertex.rows();
                                EXPECT_EQ(rows.normal.cols(), 12);
                                return absl::OkStatus();
                              })
                  .ok());
  EXPECT_EQ(next, 150);
  const absl::Status enough = running.client().GetWeights(
      binding.binding_id, WeightPrecision::kCachedFloat32, 0, 0,
      [](const WeightRows&) { return absl::AbortedError("enough"); });
  EXPECT_EQ(enough, absl::AbortedError("enough"));
}

TEST(ClientLibrary, TheRigOfABindingComesBack) {
  RunningServer running;
  const RigArrays rig =
      running.client().GetRig(running.BindBall().binding_id).value();
  EXPECT_EQ(rig.vertices, Cube().vertices());
  EXPECT_EQ(rig.faces, Cube().faces());
}

TEST(ClientLibrary, TellsWhenNobodyAnswers) {
  const absl::Status status =
      Client::Connect("unix:/nonexistent/deformd.sock",
                      {.connect_timeout = std::chrono::milliseconds(10)})
          .status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_EQ(DetailOf(status).reason, "SERVER_UNREACHABLE");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("no server answers at unix:/nonexistent"));
}

}  // namespace
}  // namespace deform
