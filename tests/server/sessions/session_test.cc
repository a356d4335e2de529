#include "server/sessions/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

// Float weights and frames; D of the cube is 3.5.
constexpr double kFrameTolerance = 1e-6 * 3.5;

class SessionTest : public testing::Test {
 protected:
  FakeStream Join(Delivery delivery) {
    FakeStream stream;
    auto joined = session_->Join(delivery, FrameWishes{}, stream.receiver);
    EXPECT_TRUE(joined.ok()) << joined.status();
    stream.participant = std::move(joined->participant);
    stream.joined = joined->state;
    stream.pose = joined->pose;
    return stream;
  }
  // Joins and takes the first frame.
  FakeStream JoinAndSee(Delivery delivery) {
    FakeStream stream = Join(delivery);
    rooms_.executor.RunAll();
    stream.TakeFrame();
    return stream;
  }
  Rejection SubmitBad(FakeStream& stream, uint64_t sequence,
                      const absl::StatusOr<PoseUpdate>& update) {
    stream.participant->Submit(sequence, update);
    return std::get<Rejection>(stream.participant->Take().value());
  }

  SessionRooms rooms_;
  std::shared_ptr<Session> session_ = Session::Create(
      "s", rooms_.bindings().Use("t", rooms_.binding_id, "session s").value(),
      {}, rooms_.Environment());
};

TEST_F(SessionTest, ShowsTheStateAtJoining) {
  FakeStream stream = Join(Delivery::kLatest);
  EXPECT_EQ(stream.joined.revision, 0u);
  EXPECT_EQ(stream.joined.epoch, 1u);
  EXPECT_EQ(stream.joined.participants, 1);
  EXPECT_EQ(stream.pose.vertices, BallCage().vertices());
  rooms_.executor.RunAll();
  EXPECT_GT(stream.receiver->wakes, 0);
  const FrameToSend sent = stream.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 0u);
  EXPECT_TRUE(sent.tells_origin);
}

TEST_F(SessionTest, DeformsByTheNewestPose) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  for (uint64_t i = 1; i <= 5; ++i) {
    stream.participant->Submit(i,
                               MovedBy({0.1 * static_cast<double>(i), 0, 0}));
  }
  EXPECT_EQ(rooms_.executor.RunAll(), 1);
  const FrameToSend sent = stream.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 1u);
  EXPECT_EQ(sent.answers_sequence, 5u);
  Positions expected = Icosphere(0.5, 1).positions;
  expected.col(0).array() += 0.5;
  EXPECT_LT((Decoded(*sent.frame) - expected).cwiseAbs().maxCoeff(),
            kFrameTolerance);
}

TEST_F(SessionTest, OneFrameServesAllAndAnswersEachForItself) {
  FakeStream a = JoinAndSee(Delivery::kLatest);
  FakeStream b = JoinAndSee(Delivery::kLatest);
  a.participant->Submit(4, MoveVertex(0, {-2, -1, -1}));
  b.participant->Submit(9, MoveVertex(7, {2, 1, 1}));
  EXPECT_EQ(rooms_.executor.RunAll(), 1);
  const FrameToSend to_a = a.TakeFrame();
  const FrameToSend to_b = b.TakeFrame();
  EXPECT_EQ(to_a.frame, to_b.frame);
  EXPECT_EQ(to_a.answers_sequence, 4u);
  EXPECT_EQ(to_b.answers_sequence, 9u);
}

TEST_F(SessionTest, AFrameAnswersThePoseThatAnEarlierOneContained) {
  FakeStream a = JoinAndSee(Delivery::kLatest);
  FakeStream b = JoinAndSee(Delivery::kLatest);
  a.participant->Submit(1, MoveVertex(0, {-2, -1, -1}));
  rooms_.executor.RunAll();
  b.participant->Submit(1, MoveVertex(7, {2, 1, 1}));
  rooms_.executor.RunAll();
  const FrameToSend sent = a.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 2u);
  EXPECT_EQ(sent.answers_sequence, 1u);
  EXPECT_EQ(sent.skipped_revisions, 1u);
}

TEST_F(SessionTest, LateJoinersSeeWhatIs) {
  FakeStream first = JoinAndSee(Delivery::kLatest);
  first.participant->Submit(1, MovedBy({1, 2, 3}));
  rooms_.executor.RunAll();
  FakeStream late = Join(Delivery::kLatest);
  EXPECT_EQ(late.joined.revision, 1u);
  EXPECT_EQ(late.pose.vertices, MovedBy({1, 2, 3}).positions);
  // Without a step: the frame is there.
  const FrameToSend sent = late.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 1u);
  EXPECT_EQ(sent.answers_sequence, 0u);
  EXPECT_TRUE(sent.tells_origin);
}

TEST_F(SessionTest, WhoJoinsSeesTheStateBeforeItsOwnPoses) {
  FakeStream stream = Join(Delivery::kEvery);
  stream.participant->Submit(1, MovedBy({1, 0, 0}));
  rooms_.executor.RunAll();
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 0u);
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 1u);
}

TEST_F(SessionTest, AppliesPosesWhoseSenderHasLeft) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  stream.participant->Submit(1, MovedBy({1, 0, 0}));
  stream.participant.reset();
  rooms_.executor.RunAll();
  EXPECT_EQ(session_->state().revision, 1u);
  EXPECT_EQ(session_->state().participants, 0);
  FakeStream late = JoinAndSee(Delivery::kLatest);
  EXPECT_EQ(late.joined.revision, 1u);
}

TEST_F(SessionTest, MovesTheOriginOnlyWhenTheRigHasMovedFar) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  stream.participant->Submit(1, MovedBy({0.8, 0, 0}));  // D / 4 is 0.87.
  rooms_.executor.RunAll();
  FrameToSend sent = stream.TakeFrame();
  EXPECT_FALSE(sent.tells_origin);
  EXPECT_EQ(sent.frame->info.origin, Vec3::Zero());
  stream.participant->Submit(2, MovedBy({1e6, 0, 0}));
  rooms_.executor.RunAll();
  sent = stream.TakeFrame();
  EXPECT_TRUE(sent.tells_origin);
  EXPECT_EQ(sent.frame->info.origin, Vec3(1e6, 0, 0));
  // A million units away the model keeps its digits.
  Positions expected = Icosphere(0.5, 1).positions;
  expected.col(0).array() += 1e6;
  EXPECT_LT((Decoded(*sent.frame) - expected).cwiseAbs().maxCoeff(),
            kFrameTolerance);
}

TEST_F(SessionTest, EveryPoseBecomesARevision) {
  FakeStream stream = JoinAndSee(Delivery::kEvery);
  uint64_t sent = 0;
  for (uint64_t revision = 1; revision <= 20; ++revision) {
    while (sent < 20 && stream.participant->WantsPoses()) {
      ++sent;
      stream.participant->Submit(sent, MovedBy({0.1 * sent, 0, 0}));
    }
    rooms_.executor.RunAll();
    const FrameToSend frame = stream.TakeFrame();
    EXPECT_EQ(frame.frame->info.revision, revision);
    EXPECT_EQ(frame.answers_sequence, revision);
  }
}

TEST_F(SessionTest, TakesOnlyAFewPosesAheadWithEvery) {
  FakeStream stream = JoinAndSee(Delivery::kEvery);
  for (int64_t i = 1; i <= Session::kMaxOwnSteps; ++i) {
    EXPECT_TRUE(stream.participant->WantsPoses());
    stream.participant->Submit(i, MovedBy({0.1, 0, 0}));
  }
  EXPECT_FALSE(stream.participant->WantsPoses());
  const int wakes = stream.receiver->wakes;
  rooms_.executor.RunOne();
  EXPECT_GT(stream.receiver->wakes, wakes);
  EXPECT_TRUE(stream.participant->WantsPoses());
}

TEST_F(SessionTest, WaitsForAReceiverOfEveryFrame) {
  FakeStream slow = JoinAndSee(Delivery::kEvery);
  FakeStream quick = JoinAndSee(Delivery::kLatest);
  for (uint64_t i = 1; i <= 10; ++i) {
    quick.participant->Submit(i, MovedBy({0.1, 0, 0}));
    rooms_.executor.RunAll();
  }
  EXPECT_EQ(session_->state().revision, Outbox::kMaxFrames);
  EXPECT_EQ(slow.TakeFrame().frame->info.revision, 1u);
  // There is room again: what waited goes on, all of it in one step.
  EXPECT_EQ(rooms_.executor.RunAll(), 1);
  EXPECT_EQ(session_->state().revision, Outbox::kMaxFrames + 1);
}

TEST_F(SessionTest, GoesOnWhenTheOneItWaitedForLeaves) {
  FakeStream slow = JoinAndSee(Delivery::kEvery);
  FakeStream quick = JoinAndSee(Delivery::kLatest);
  for (uint64_t i = 1; i <= 10; ++i) {
    quick.participant->Submit(i, MovedBy({0.1, 0, 0}));
    rooms_.executor.RunAll();
  }
  slow.participant->Leave();
  EXPECT_EQ(rooms_.executor.RunAll(), 1);
}

TEST_F(SessionTest, ASlowReceiverOfTheLatestHoldsNobodyUp) {
  FakeStream slow = JoinAndSee(Delivery::kLatest);
  FakeStream quick = JoinAndSee(Delivery::kEvery);
  for (uint64_t i = 1; i <= 100; ++i) {
    quick.participant->Submit(i, MovedBy({0.1, 0, 0}));
    rooms_.executor.RunAll();
    EXPECT_EQ(quick.TakeFrame().frame->info.revision, i);
  }
  EXPECT_EQ(slow.TakeFrame().skipped_revisions, 99u);
}

TEST_F(SessionTest, StallsAreJudgedByProgress) {
  FakeStream stream = Join(Delivery::kLatest);
  rooms_.executor.RunAll();
  // Nothing is being sent: it may take its time.
  rooms_.clock.Advance(std::chrono::hours(1));
  EXPECT_TRUE(stream.participant->CheckStall().ok());
  stream.TakeFrame();
  rooms_.clock.Advance(std::chrono::seconds(9));
  stream.participant->Progressed();
  rooms_.clock.Advance(std::chrono::seconds(10));
  EXPECT_TRUE(stream.participant->CheckStall().ok());
  rooms_.clock.Advance(std::chrono::milliseconds(1));
  const absl::Status stall = stream.participant->CheckStall();
  EXPECT_EQ(stall.code(), absl::StatusCode::kAborted);
  EXPECT_EQ(stall.message(),
            "the stream took no message for 10 s (stall-timeout): read faster, "
            "or join again");
  EXPECT_EQ(DetailOf(stall).reason, "RECEIVER_STALLED");
}

TEST_F(SessionTest, HavingSentEverythingIsNoStall) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  EXPECT_FALSE(stream.participant->Take().has_value());
  rooms_.clock.Advance(std::chrono::hours(1));
  EXPECT_TRUE(stream.participant->CheckStall().ok());
}

TEST_F(SessionTest, RefusesABadPoseAndGoesOn) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  const Rejection bad = SubmitBad(stream, 1, MoveVertex(8, {0, 0, 0}));
  EXPECT_EQ(bad.sequence, 1u);
  EXPECT_EQ(bad.status.message(), "pose entry 0 refers to vertex 8 of 8");
  EXPECT_EQ(DetailOf(bad.status).reason, "INDEX_OUT_OF_RANGE");
  EXPECT_EQ(rooms_.executor.RunAll(), 0);
  stream.participant->Submit(1, MoveVertex(7, {2, 2, 2}));
  rooms_.executor.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 1u);
}

TEST_F(SessionTest, SequencesRise) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  EXPECT_THAT(
      std::string(SubmitBad(stream, 0, MovedBy({0, 0, 0})).status.message()),
      HasSubstr("pose 0 comes after pose 0"));
  stream.participant->Submit(5, MovedBy({0, 0, 0}));
  const Rejection again = SubmitBad(stream, 5, MovedBy({0, 0, 0}));
  EXPECT_EQ(DetailOf(again.status).reason, "SEQUENCE_NOT_RISING");
  EXPECT_EQ(again.status.message(),
            "pose 5 comes after pose 5; sequences rise from 1");
}

TEST_F(SessionTest, PassesOnWhatCouldNotBeConverted) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  const Rejection bad =
      SubmitBad(stream, 3, InvalidInput("WRONG_LENGTH", "f", "odd"));
  EXPECT_EQ(bad.sequence, 3u);
  EXPECT_EQ(bad.status.message(), "odd");
}

TEST_F(SessionTest, HalfClosingEndsAfterTheLastAnswer) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  stream.participant->Submit(1, MovedBy({1, 0, 0}));
  stream.participant->HalfClose();
  EXPECT_FALSE(stream.participant->Take().has_value());
  rooms_.executor.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 1u);
  EXPECT_TRUE(stream.TakeEnd().ok());
}

TEST_F(SessionTest, EndingTellsEverybody) {
  FakeStream stream = JoinAndSee(Delivery::kEvery);
  stream.participant->Submit(1, MovedBy({1, 0, 0}));
  session_->End(absl::NotFoundError("gone"));
  EXPECT_EQ(stream.TakeEnd().message(), "gone");
  EXPECT_FALSE(stream.participant->WantsPoses());
  EXPECT_EQ(
      session_
          ->Join(Delivery::kLatest, FrameWishes{}, std::weak_ptr<Receiver>())
          .status()
          .message(),
      "gone");
}

TEST_F(SessionTest, EndingLetsTheBindingGo) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  EXPECT_FALSE(rooms_.bindings().Remove("t", rooms_.binding_id).ok());
  session_->End(absl::NotFoundError("gone"));
  EXPECT_TRUE(rooms_.bindings().Remove("t", rooms_.binding_id).ok());
}

TEST_F(SessionTest, DrainingAnswersWhatCameBefore) {
  FakeStream stream = JoinAndSee(Delivery::kLatest);
  stream.participant->Submit(1, MovedBy({1, 0, 0}));
  session_->Drain(absl::UnavailableError("draining"));
  stream.participant->Submit(2, MovedBy({2, 0, 0}));  // Too late.
  rooms_.executor.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 1u);
  EXPECT_EQ(stream.TakeEnd().message(), "draining");
}

TEST_F(SessionTest, HasRoomForSoManyParticipants) {
  std::vector<FakeStream> streams;
  for (int i = 0; i < 3; ++i) streams.push_back(Join(Delivery::kLatest));
  const auto full = session_->Join(Delivery::kLatest, FrameWishes{},
                                   std::weak_ptr<Receiver>());
  EXPECT_EQ(full.status().message(),
            "the session has 3 participants, its limit (max-participants)");
  EXPECT_EQ(DetailOf(full.status()).reason, "TOO_MANY_PARTICIPANTS");
  streams.pop_back();
  Join(Delivery::kLatest);
}

TEST_F(SessionTest, IsInTheExecutorAtMostOnce) {
  FakeStream stream = JoinAndSee(Delivery::kEvery);
  for (uint64_t i = 1; i <= 3; ++i) {
    stream.participant->Submit(i, MovedBy({0.1, 0, 0}));
    EXPECT_EQ(rooms_.executor.waiting(), 1u);
  }
}

}  // namespace
}  // namespace deform::server
