// Poses in, frames out, over a real connection.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "absl/cleanup/cleanup.h"
#include "core/base/error.h"
#include "deform/v1/session.grpc.pb.h"
#include "tests/end_to_end/raw_call.h"
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
  const absl::Cleanup stop = [&] {
    stream.Cancel();
    sender.join();
  };
  Frame frame;
  for (uint64_t i = 0; i <= kPoses; ++i) {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
    ASSERT_EQ(frame.revision, i);
    ASSERT_EQ(frame.answers_sequence, i);
    ASSERT_EQ(frame.skipped_revisions, 0u);
    ExpectBallAt(frame, {0.01 * static_cast<double>(i), 0, 0});
  }
  EXPECT_EQ(stream.NextFrame(frame).code(), absl::StatusCode::kOutOfRange);
}

TEST(Deform, LeavesFixedHandlesAndClampedPointsAtRest) {
  RunningServer server;
  const ModelInfo model = server.client().RegisterModel(Ball(), "b").value();
  BindingSpec spec{.model_id = model.model_id, .scheme = "s_cc"};
  spec.rig = RigArrays(RigKind::kHandles, 3, Positions::Zero(1, 3), Faces());
  spec.add_box_handles = true;
  spec.clamped = {8, 3};
  const BindingInfo binding = server.client().CreateBinding(spec).value();
  EXPECT_EQ(binding.vertex_count, 1);
  EXPECT_EQ(binding.fixed_handle_count, 8);
  EXPECT_EQ(binding.clamped, (std::vector<int64_t>{3, 8}));
  EXPECT_EQ(server.client().GetRig(binding.binding_id)->fixed.rows(), 8);
  const SessionInfo session =
      server.client().CreateSession(binding.binding_id).value();
  auto stream = server.client().Deform(session.session_id).value();
  EXPECT_EQ(stream.joined().vertex_count, 1);
  // A corner of the box cannot be moved, the handle in the middle can.
  stream.Send({.vertices = {1}, .positions = Positions::Ones(1, 3)}).value();
  Frame frame;
  absl::Status refused;
  while (refused.ok()) refused = stream.NextFrame(frame);
  EXPECT_EQ(DetailOf(refused).reason, "FIXED_HANDLE");
  const uint64_t sequence =
      stream.Send({.positions = Positions::Constant(1, 3, 0.1)}).value();
  do {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
  } while (frame.answers_sequence < sequence);
  const Positions moved = frame.DoublePositions() - Ball().positions();
  EXPECT_LT(moved.row(3).norm(), kFrameTolerance);
  EXPECT_LT(moved.row(8).norm(), kFrameTolerance);
  EXPECT_GT(moved.row(4).norm(), 0.01);
  EXPECT_LT(moved.row(4).norm(), 0.1);
}

TEST(Deform, MergesPartialPoses) {
  RunningServer server;
  auto stream = server.client().Deform(server.BallSession()).value();
  Positions to(1, 3);
  to << 2, 2, 2;
  const int32_t corner = 7;
  stream.Send({.vertices = {corner}, .positions = to}).value();
  const uint64_t last = stream.Send({.stretch_blend = 0.5}).value();
  Frame frame;
  do {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
  } while (frame.answers_sequence < last);
  auto late = server.client().Deform(stream.joined().session_id).value();
  Positions expected = Cube().vertices();
  expected.row(corner) = to;
  EXPECT_EQ(late.joined().pose.vertices, expected);
  EXPECT_EQ(late.joined().pose.stretch_blend, 0.5);
  Frame seen;
  ASSERT_TRUE(late.NextFrame(seen).ok());
  EXPECT_EQ(seen.revision, frame.revision);
  EXPECT_EQ(seen.positions, frame.positions);
}

TEST(Deform, LatestAccountsForWhatItSkips) {
  constexpr uint64_t kPoses = 2000;
  RunningServer server;
  auto stream = server.client().Deform(server.BallSession()).value();
  for (uint64_t i = 1; i <= kPoses; ++i) {
    ASSERT_TRUE(
        stream.Send(MovedBy({0.001 * static_cast<double>(i), 0, 0})).ok());
  }
  stream.Close();
  Frame frame;
  uint64_t revisions = 0;
  uint64_t frames = 0;
  while (stream.NextFrame(frame).ok()) {
    revisions += 1 + frame.skipped_revisions;
    ++frames;
  }
  EXPECT_TRUE(stream.ended());
  EXPECT_EQ(frame.answers_sequence, kPoses);
  EXPECT_EQ(revisions, frame.revision + 1);
  EXPECT_LE(frames, kPoses + 1);
  ExpectBallAt(frame, {0.001 * kPoses, 0, 0});
}

TEST(Deform, WhoWantsFewFramesGetsTheLastStateToo) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto editor = server.client().Deform(session).value();
  auto viewer =
      server.client()
          .Deform(session, DeformOptions{.max_fps = 20,
                                         .role = ParticipantRole::kViewer})
          .value();
  Frame frame;
  uint64_t last = 0;
  for (int i = 1; i <= 50; ++i) {
    last = editor.Send(MovedBy({0.01 * i, 0, 0})).value();
  }
  do {
    ASSERT_TRUE(editor.NextFrame(frame).ok());
  } while (frame.answers_sequence < last);
  const uint64_t revision = frame.revision;
  uint64_t received = 0, skipped = 0;
  do {
    ASSERT_TRUE(viewer.NextFrame(frame).ok());
    ++received;
    skipped += frame.skipped_revisions;
  } while (frame.revision < revision);
  // With that of the state at joining.
  EXPECT_EQ(received + skipped, revision + 1);
  ExpectBallAt(frame, {0.5, 0, 0});
}

TEST(Deform, ALimitedStreamIsClosedWithoutWaiting) {
  RunningServer server;
  // One frame in 100 seconds.
  auto stream =
      server.client()
          .Deform(server.BallSession(), DeformOptions{.max_fps = 0.01})
          .value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  const uint64_t sequence = stream.Send(MovedBy({1, 0, 0})).value();
  stream.Close();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.answers_sequence, sequence);
  EXPECT_EQ(stream.NextFrame(frame).code(), absl::StatusCode::kOutOfRange);
}

TEST(Deform, ParticipantsShareTheSession) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto a = server.client().Deform(session).value();
  auto b = server.client().Deform(session, Delivery::kEvery).value();
  EXPECT_EQ(server.client().GetSession(session)->participant_count, 2);
  Frame frame;
  ASSERT_TRUE(b.NextFrame(frame).ok());
  a.Send(MovedBy({1, 1, 1})).value();
  ASSERT_TRUE(b.NextFrame(frame).ok());
  EXPECT_EQ(frame.revision, 1u);
  EXPECT_EQ(frame.answers_sequence, 0u);
  ExpectBallAt(frame, {1, 1, 1});
}

TEST(Deform, KeepsTheDigitsOfAModelFarAway) {
  RunningServer server;
  auto stream =
      server.client().Deform(server.BallSession(), Delivery::kEvery).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  for (const double far : {1e3, 1e6, 1e6 + 0.5}) {
    stream.Send(MovedBy({far, 0, 0})).value();
    ASSERT_TRUE(stream.NextFrame(frame).ok());
    ExpectBallAt(frame, {far, 0, 0});
  }
}

TEST(Deform, FramesLargerThanAChunkArriveWhole) {
  RunningServer server;
  Client& client = server.client();
  // 163,842 points: 1.9 MB a frame, two chunks.
  const Mesh large = MeshOf(Icosphere(0.5, 7));
  const ModelInfo model = client.RegisterModel(large, "").value();
  const BindingInfo binding =
      client.CreateBinding({.model_id = model.model_id, .rig = Cube()}).value();
  auto stream =
      client.Deform(client.CreateSession(binding.binding_id)->session_id)
          .value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_LT((frame.DoublePositions() - large.positions()).cwiseAbs().maxCoeff(),
            kFrameTolerance);
}

TEST(Deform, ABadPoseIsRejectedAndTheStreamGoesOn) {
  RunningServer server;
  auto stream = server.client().Deform(server.BallSession()).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  const uint64_t bad =
      stream.Send({.positions = Positions::Zero(3, 3)}).value();
  const absl::Status rejected = stream.NextFrame(frame);
  EXPECT_EQ(rejected.message(),
            "pose has 3 positions, but the rig has 8 vertices");
  EXPECT_EQ(DetailOf(rejected).reason, "WRONG_LENGTH");
  EXPECT_EQ(stream.rejected_sequence(), bad);
  EXPECT_FALSE(stream.ended());
  const uint64_t good = stream.Send(MovedBy({1, 0, 0})).value();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.answers_sequence, good);
}

TEST(Deform, ManyBadPosesAreAllAnswered) {
  RunningServer server;
  auto stream = server.client().Deform(server.BallSession()).value();
  constexpr int kBad = 100;
  for (int i = 0; i < kBad; ++i) {
    stream.Send({.positions = Positions::Zero(1, 3)}).value();
  }
  stream.Close();
  Frame frame;
  int rejected = 0;
  absl::Status status;
  while (!stream.ended()) {
    status = stream.NextFrame(frame);
    if (DetailOf(status).reason == "WRONG_LENGTH") ++rejected;
  }
  EXPECT_EQ(rejected, kBad);
  EXPECT_EQ(status.code(), absl::StatusCode::kOutOfRange);
}

TEST(Deform, DeletingTheSessionEndsItsStreams) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto stream = server.client().Deform(session).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  ASSERT_TRUE(server.client().DeleteSession(session).ok());
  const absl::Status end = stream.NextFrame(frame);
  EXPECT_EQ(end.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(DetailOf(end).reason, "SESSION_DELETED");
  EXPECT_TRUE(stream.ended());
}

TEST(Deform, TheBindingOfASessionStays) {
  RunningServer server;
  const BindingInfo binding = server.BindBall();
  const std::string session =
      server.client().CreateSession(binding.binding_id, "mine")->session_id;
  const absl::Status used = server.client().DeleteBinding(binding.binding_id);
  EXPECT_EQ(DetailOf(used).reason, "BINDING_IN_USE");
  EXPECT_THAT(std::string(used.message()), HasSubstr("session mine"));
  ASSERT_TRUE(server.client().DeleteSession(session).ok());
  EXPECT_TRUE(server.client().DeleteBinding(binding.binding_id).ok());
}

TEST(Deform, SessionsOfOneTenantAreNothingToAnother) {
  RunningServer server;
  const std::string session = server.BallSession();
  Client other = server.Connect("other");
  EXPECT_EQ(DetailOf(other.Deform(session).status()).reason,
            "SESSION_NOT_FOUND");
  EXPECT_THAT(other.ListSessions().value(), testing::IsEmpty());
}

constexpr char kDeform[] = "/deform.v1.SessionService/Deform";

v1::DeformResponse FirstAnswer(const RawAnswer& answer) {
  v1::DeformResponse response;
  EXPECT_TRUE(response.ParseFromString(answer.first));
  return response;
}

TEST(Deform, BeginsWithJoin) {
  RunningServer server;
  v1::DeformRequest pose;
  pose.mutable_pose()->set_sequence(1);
  const RawAnswer answer =
      RawCall(server.address(), kDeform, pose.SerializeAsString());
  EXPECT_EQ(answer.status.message(), "the first message of a stream is join");
  EXPECT_EQ(DetailOf(answer.status).reason, "JOIN_FIRST");
  // In-band too, for those who cannot read trailers.
  const absl::Status ended = FromRpcStatus(FirstAnswer(answer).ended());
  EXPECT_EQ(ended.code(), answer.status.code());
  EXPECT_EQ(DetailOf(ended).reason, "JOIN_FIRST");
}

TEST(Deform, RefusesGarbledMessages) {
  RunningServer server;
  const RawAnswer answer = RawCall(server.address(), kDeform, "\xff\xff\xff");
  EXPECT_EQ(DetailOf(answer.status).reason, "MALFORMED_MESSAGE");
  EXPECT_EQ(FirstAnswer(answer).ended().code(), 3);
}

TEST(Deform, RefusesMessagesThatAreTooLarge) {
  RunningServer server;
  EXPECT_FALSE(
      RawCall(server.address(), kDeform, std::string((64 << 20) + 1, '\0'))
          .status.ok());
  EXPECT_TRUE(server.client().ListSessions().ok());
}

TEST(Deform, HasPosesOnlyAfterJoining) {
  RunningServer server;
  v1::DeformRequest join;
  join.mutable_join()->set_session_id(server.BallSession());
  const auto stub = v1::SessionService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  const auto stream = stub->Deform(&context);
  stream->Write(join);
  stream->Write(join);
  v1::DeformResponse response;
  while (stream->Read(&response)) {
  }
  EXPECT_EQ(DetailOf(FromGrpc(stream->Finish())).reason, "POSE_EXPECTED");
}

TEST(Deform, WhoDoesNotJoinInTimeIsToldSo) {
  server::Options options = TestOptions();
  options.stall_timeout = {0.2};
  RunningServer server(options);
  const auto stub = v1::SessionService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  const auto stream = stub->Deform(&context);
  v1::DeformResponse response;
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(DetailOf(FromRpcStatus(response.ended())).reason, "JOIN_TIMEOUT");
}

TEST(Deform, WhoStopsReadingIsPutOutAndToldSo) {
  server::Options options = TestOptions();
  options.stall_timeout = {1};
  RunningServer server(options);
  Client& client = server.client();
  // 1.9 MB a frame: some of them fill what a connection holds on its way.
  const ModelInfo model =
      client.RegisterModel(MeshOf(Icosphere(0.5, 7)), "").value();
  const BindingInfo binding =
      client.CreateBinding({.model_id = model.model_id, .rig = Cube()}).value();
  const std::string session =
      client.CreateSession(binding.binding_id)->session_id;
  const auto stub = v1::SessionService::NewStub(PlainChannel(server.address()));
  grpc::ClientContext context;
  // The join comes with the call: in time on a busy machine, too.
  context.set_initial_metadata_corked(true);
  const auto stream = stub->Deform(&context);
  v1::DeformRequest join;
  join.mutable_join()->set_session_id(session);
  stream->Write(join);
  v1::DeformResponse response;
  ASSERT_TRUE(stream->Read(&response));
  auto other = client.Deform(session).value();
  Frame frame;
  while (client.GetSession(session)->participant_count > 1) {
    other.Send(MovedBy({0, 0, 0})).value();
    ASSERT_TRUE(other.NextFrame(frame).ok());
  }
  // Who reads at last finds what was on its way, and the reason.
  while (stream->Read(&response)) {
  }
  const absl::Status end = FromGrpc(stream->Finish());
  EXPECT_EQ(end.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(DetailOf(end).reason, "RECEIVER_STALLED");
}

TEST(Deform, LeavesWhenTheClientVanishes) {
  RunningServer server;
  const std::string session = server.BallSession();
  {
    auto stream = server.client().Deform(session).value();
    Frame frame;
    ASSERT_TRUE(stream.NextFrame(frame).ok());
    stream.Cancel();
  }
  while (server.client().GetSession(session)->participant_count > 0) {
    std::this_thread::yield();
  }
}

TEST(Deform, DrainingAnswersThePosesThatCameAndSaysWhy) {
  RunningServer server;
  const std::string session = server.BallSession();
  auto stream =
      server.client()
          .Deform(session, {.delivery = Delivery::kEvery,
                            .reconnect_for = std::chrono::milliseconds(0)})
          .value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  stream.Send(MovedBy({1, 0, 0})).value();
  while (server.client().GetSession(session)->revision == 0) {
    std::this_thread::yield();
  }
  EXPECT_TRUE(server.server().Drain(std::chrono::seconds(60)));
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.answers_sequence, 1u);
  const absl::Status end = stream.NextFrame(frame);
  EXPECT_EQ(end.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(DetailOf(end).reason, "SERVER_DRAINING");
}

TEST(Deform, ManyClientsOfManySessionsAtOnce) {
  RunningServer server;
  const BindingInfo binding = server.BindBall();
  std::vector<std::thread> threads;
  for (int s = 0; s < 8; ++s) {
    threads.emplace_back([&, s] {
      Client client = server.Connect();
      const std::string id =
          client.CreateSession(binding.binding_id, "s" + std::to_string(s / 2))
              ->session_id;
      auto stream =
          client.Deform(id, s % 2 ? Delivery::kEvery : Delivery::kLatest)
              .value();
      Frame frame;
      ASSERT_TRUE(stream.NextFrame(frame).ok());
      for (int i = 1; i <= 100; ++i) {
        const uint64_t sent = stream.Send(MovedBy({0.01 * i, 0, 0})).value();
        do {
          ASSERT_TRUE(stream.NextFrame(frame).ok());
        } while (frame.answers_sequence < sent);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_THAT(server.client().ListSessions().value(), testing::SizeIs(4));
}

}  // namespace
}  // namespace deform
