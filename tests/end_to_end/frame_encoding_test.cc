// Frames in fewer bytes, over a real connection.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "core/base/error.h"
#include "deform/v1/session.grpc.pb.h"
#include "tests/end_to_end/raw_call.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;

// Of D, the diagonal of the cube.
constexpr double kFraction = 1e-5;
const double kDiagonal = std::sqrt(12.0);
const double kTolerance = kFraction * kDiagonal;
// Frames of floats are compared with others: their own rounding, within 2.
constexpr double kFloatRounding = 2 * 1.2e-7;

// A corner of the cube is dragged, smoothly, within 0.3 of its place.
PoseUpdate DragAt(double seconds) {
  PoseUpdate update{.vertices = {7}, .positions = Positions::Ones(1, 3)};
  for (int d = 0; d < 3; ++d) {
    update.positions(0, d) += 0.3 * std::sin((2 + 0.7 * d) * seconds + d);
  }
  return update;
}

double Difference(const Frame& a, const Frame& b) {
  return (a.DoublePositions() - b.DoublePositions())
      .rowwise()
      .norm()
      .maxCoeff();
}

DeformOptions Within(double fraction, std::vector<std::string> encodings = {},
                     Delivery delivery = Delivery::kEvery) {
  return {.delivery = delivery,
          .tolerance_fraction = fraction,
          .encodings = std::move(encodings)};
}

class FrameEncodings : public testing::Test {
 protected:
  // Of 10,242 points.
  std::string LargeSession() {
    const ModelInfo model =
        client().RegisterModel(MeshOf(Icosphere(0.5, 5)), "large").value();
    const BindingInfo binding =
        client()
            .CreateBinding({.model_id = model.model_id, .rig = Cube()})
            .value();
    return client().CreateSession(binding.binding_id)->session_id;
  }
  Client& client() { return server_.client(); }

  RunningServer server_;
};

struct Played {
  int64_t bytes = 0, exact_bytes = 0, frames = 0;
  double worst = 0;
};

// Both see every revision; the first poses.
Played PlayBoth(DeformStream& stream, DeformStream& exact, int poses,
                const std::function<PoseUpdate(int)>& pose) {
  Played played;
  Frame frame, judge;
  for (int i = 0; i <= poses; ++i) {
    if (i > 0) stream.Send(pose(i)).value();
    EXPECT_TRUE(stream.NextFrame(frame).ok());
    EXPECT_TRUE(exact.NextFrame(judge).ok());
    EXPECT_EQ(frame.revision, judge.revision);
    EXPECT_EQ(frame.skipped_revisions, 0u);
    played.worst = std::max(played.worst, Difference(frame, judge));
    if (i == 0) continue;
    played.bytes += frame.bytes;
    played.exact_bytes += judge.bytes;
    ++played.frames;
  }
  return played;
}

TEST_F(FrameEncodings, EachKeepsTheTolerance) {
  const std::string session = LargeSession();
  // Of a cube, 16 bits keep 7.7e-6 D.
  for (const char* encoding : {"float32", "quantized16", "predicted"}) {
    auto stream =
        client().Deform(session, Within(kFraction, {encoding})).value();
    auto exact = client().Deform(session, Delivery::kEvery).value();
    EXPECT_EQ(stream.joined().encoding, encoding);
    EXPECT_DOUBLE_EQ(stream.joined().tolerance,
                     encoding == std::string("float32") ? 0 : kTolerance);
    const Played played =
        PlayBoth(stream, exact, 20, [](int i) { return DragAt(i / 60.0); });
    EXPECT_LE(played.worst, kTolerance + kFloatRounding) << encoding;
  }
}

TEST_F(FrameEncodings, TheCheapestIsTakenUnlessOneIsNamed) {
  const std::string session = LargeSession();
  auto stream = client().Deform(session, Within(kFraction)).value();
  EXPECT_EQ(stream.joined().encoding, "predicted");
  auto exact = client().Deform(session, Delivery::kEvery).value();
  const Played smooth =
      PlayBoth(stream, exact, 100, [](int i) { return DragAt(i / 60.0); });
  EXPECT_LE(smooth.worst, kTolerance + kFloatRounding);
  EXPECT_LT(smooth.bytes, smooth.exact_bytes / 8);
}

// The integers of a frame are those of the server, so nothing adds up.
TEST_F(FrameEncodings, TenThousandFramesLaterTheToleranceStillHolds) {
  const std::string session = server_.BallSession();
  auto stream =
      client().Deform(session, Within(kFraction, {"predicted"})).value();
  auto exact = client().Deform(session, Delivery::kEvery).value();
  const Played played =
      PlayBoth(stream, exact, 10000, [](int i) { return DragAt(i / 60.0); });
  EXPECT_EQ(played.frames, 10000);
  EXPECT_LE(played.worst, kTolerance + kFloatRounding);
}

TEST_F(FrameEncodings, TheLatestComesAsItIsHoweverManyWereSkipped) {
  const std::string session = server_.BallSession();
  auto stream =
      client()
          .Deform(session, Within(kFraction, {"predicted"}, Delivery::kLatest))
          .value();
  constexpr uint64_t kPoses = 2000;
  for (uint64_t i = 1; i <= kPoses; ++i) {
    stream.Send(DragAt(static_cast<double>(i) / 60)).value();
  }
  stream.Close();
  Frame frame;
  uint64_t revisions = 0;
  while (stream.NextFrame(frame).ok()) {
    revisions += 1 + frame.skipped_revisions;
  }
  EXPECT_EQ(frame.answers_sequence, kPoses);
  EXPECT_EQ(revisions, frame.revision + 1);
  auto exact = client().Deform(session).value();
  Frame judge;
  ASSERT_TRUE(exact.NextFrame(judge).ok());
  EXPECT_EQ(judge.revision, frame.revision);
  EXPECT_LE(Difference(frame, judge), kTolerance + kFloatRounding);
}

TEST_F(FrameEncodings, AJumpOffTheGridComesAsFloats) {
  const std::string session = server_.BallSession();
  auto stream = client().Deform(session, Within(1e-6, {"predicted"})).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.encoding, "predicted");
  EXPECT_TRUE(frame.keyframe);
  // 2^20 steps of 1e-6 D reach to 1.05 D.
  Positions scaled = 20 * Cube().vertices();
  stream.Send({.positions = scaled}).value();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.encoding, "float32");
  EXPECT_NEAR(frame.DoublePositions().rowwise().norm().maxCoeff(), 10, 1e-4);
  stream.Send({.positions = Cube().vertices()}).value();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_EQ(frame.encoding, "predicted");
  EXPECT_FALSE(frame.keyframe);
  EXPECT_LE((frame.DoublePositions() - Ball().positions())
                .rowwise()
                .norm()
                .maxCoeff(),
            1e-6 * kDiagonal);
}

TEST_F(FrameEncodings, AMoveFarAwayTellsItsOriginWithAPredictedFrame) {
  auto stream =
      client().Deform(server_.BallSession(), Within(kFraction)).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  Positions far = Cube().vertices();
  far.col(0).array() += 1e6;
  stream.Send({.positions = far}).value();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_FALSE(frame.keyframe);
  EXPECT_EQ(frame.origin[0], 1e6);
  Positions expected = Ball().positions();
  expected.col(0).array() += 1e6;
  EXPECT_LE((frame.DoublePositions() - expected).rowwise().norm().maxCoeff(),
            kTolerance);
}

TEST_F(FrameEncodings, AKeyframeComesOnRequest) {
  auto stream =
      client().Deform(server_.BallSession(), Within(kFraction)).value();
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  stream.Send(DragAt(1)).value();
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_FALSE(frame.keyframe);
  ASSERT_TRUE(stream.RequestKeyframe().ok());
  Frame again;
  ASSERT_TRUE(stream.NextFrame(again).ok());
  EXPECT_TRUE(again.keyframe);
  EXPECT_EQ(again.revision, frame.revision);
  EXPECT_EQ(again.positions, frame.positions);
  stream.Close();
  EXPECT_EQ(stream.RequestKeyframe().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST_F(FrameEncodings, EveryoneHasItsOwnFormat) {
  const std::string session = server_.BallSession();
  auto first = client().Deform(session, Within(kFraction)).value();
  auto second = client().Deform(session, Within(1e-3)).value();
  auto third = client().Deform(session, Delivery::kEvery).value();
  Frame a, b, c;
  for (int i = 0; i <= 20; ++i) {
    if (i > 0) first.Send(DragAt(0.1 * i)).value();
    ASSERT_TRUE(first.NextFrame(a).ok());
    ASSERT_TRUE(second.NextFrame(b).ok());
    ASSERT_TRUE(third.NextFrame(c).ok());
    EXPECT_LE(Difference(a, c), kTolerance + kFloatRounding);
    EXPECT_LE(Difference(b, c), 1e-3 * kDiagonal);
    EXPECT_LE(a.error_bound, kTolerance);
    EXPECT_EQ(c.error_bound, 0);
  }
}

TEST_F(FrameEncodings, SaysWhatIsWrongWithTheWishes) {
  const std::string session = server_.BallSession();
  const auto refused = [&](const DeformOptions& options) {
    return client().Deform(session, options).status();
  };
  EXPECT_THAT(std::string(refused({.encodings = {"predicted"}}).message()),
              HasSubstr("encoding \"predicted\" needs a tolerance"));
  EXPECT_THAT(std::string(refused({.encodings = {"lz"}}).message()),
              HasSubstr("none of the encodings is known"));
  EXPECT_EQ(DetailOf(refused({.tolerance = 1, .tolerance_fraction = 1})).reason,
            "CONTRADICTION");
  EXPECT_EQ(DetailOf(refused({.tolerance = -1})).reason,
            "TOLERANCE_OUT_OF_RANGE");
  EXPECT_EQ(DetailOf(refused(Within(1e-9, {"predicted"}))).reason,
            "TOLERANCE_NOT_MET");
  // Floats are within any.
  EXPECT_EQ(client().Deform(session, Within(1e-9))->joined().encoding,
            "float32");
}

TEST_F(FrameEncodings, TheOrderOfPointsComesOnceBeforeTheFirstFrame) {
  v1::DeformRequest join;
  join.mutable_join()->set_session_id(server_.BallSession());
  join.mutable_join()->set_tolerance_fraction(kFraction);
  join.mutable_join()->add_encodings("predicted");
  const auto stub =
      v1::SessionService::NewStub(PlainChannel(server_.address()));
  grpc::ClientContext context;
  const auto stream = stub->Deform(&context);
  stream->Write(join);
  v1::DeformRequest again;
  again.mutable_keyframe();
  stream->Write(again);
  stream->WritesDone();
  std::vector<v1::DeformResponse::MessageCase> messages;
  v1::DeformResponse response;
  while (stream->Read(&response)) {
    messages.push_back(response.message_case());
    if (response.has_point_order()) {
      EXPECT_EQ(response.point_order().data().size(), 4u * Ball().size());
    }
  }
  EXPECT_TRUE(stream->Finish().ok());
  ASSERT_GE(messages.size(), 3u);
  EXPECT_EQ(messages[0], v1::DeformResponse::kJoined);
  EXPECT_EQ(messages[1], v1::DeformResponse::kPointOrder);
  for (size_t i = 2; i < messages.size(); ++i) {
    EXPECT_EQ(messages[i], v1::DeformResponse::kFrame);
  }
}

TEST(FrameRates, AreRefusedWithTheReason) {
  RunningServer server;
  const std::string session = server.BallSession();
  const auto refused = [&](const DeformOptions& options) {
    return server.client().Deform(session, options).status();
  };
  const absl::Status range = refused({.max_fps = -1});
  EXPECT_EQ(DetailOf(range).reason, "MAX_FPS_OUT_OF_RANGE");
  EXPECT_THAT(std::string(range.message()),
              HasSubstr("max_fps is -1, neither 0 nor within 0.01 and 1000"));
  const absl::Status all =
      refused({.delivery = Delivery::kEvery, .max_fps = 30});
  EXPECT_EQ(DetailOf(all).reason, "CONTRADICTION");
  EXPECT_THAT(std::string(all.message()),
              HasSubstr("max_fps leaves revisions out, but delivery EVERY "
                        "sends all: set one of them"));
}

}  // namespace
}  // namespace deform
