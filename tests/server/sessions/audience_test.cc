#include "server/sessions/audience.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/sessions/audience_fixture.h"

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

TEST_F(AudienceTest, GivesWhoComesFirstNothingUntilThereIsAFrame) {
  const int64_t seat = Add();
  EXPECT_TRUE(audience_.NeedsFrame(now_));
  EXPECT_TRUE(audience_.MustSeeThis(now_));
  EXPECT_THAT(audience_.Wanted(false, now_), ElementsAre(FrameKey{float32_}));
  TakeNothing(seat);
  Publish(0);
  EXPECT_FALSE(audience_.NeedsFrame(now_));
  EXPECT_THAT(audience_.Wanted(false, now_), IsEmpty());
  EXPECT_EQ(TakeFrame(seat).frame->info.revision, 0u);
}

TEST_F(AudienceTest, GivesWhoComesLaterThePresentFrame) {
  Add();
  Publish(7);
  const int64_t late = Add();
  EXPECT_FALSE(audience_.NeedsFrame(now_));
  EXPECT_EQ(TakeFrame(late).frame->info.revision, 7u);
}

TEST_F(AudienceTest, AsksForAFormatThatIsNotThereYet) {
  Add();
  Publish(1);
  const std::vector<FrameKey> before = audience_.Wanted(true, now_);
  const int64_t other = audience_.Add({.format = quantized16_}, {}, now_);
  EXPECT_THAT(audience_.Wanted(false, now_),
              ElementsAre(FrameKey{quantized16_}));
  // It has come while the next revision was encoded.
  audience_.Publish(2, Made(2, before), now_);
  EXPECT_TRUE(audience_.MustSeeThis(now_));
  Serve(2);
  EXPECT_FALSE(audience_.NeedsFrame(now_));
  EXPECT_EQ(TakeFrame(other).frame->info.revision, 2u);
}

TEST_F(AudienceTest, WantsEachFrameOnce) {
  Add();
  Add();
  EXPECT_THAT(audience_.Wanted(true, now_), ElementsAre(FrameKey{float32_}));
}

TEST_F(AudienceTest, PublishingARevisionAgainSendsItOnce) {
  const int64_t seat = Add();
  Publish(1);
  Publish(1);
  TakeFrame(seat);
  TakeNothing(seat);
}

TEST_F(AudienceTest, TellsEachWhichOfItsPosesAFrameContains) {
  const int64_t a = Add();
  const int64_t b = Add();
  audience_.Contain(a, 4);
  audience_.Contain(b, 9);
  Publish(1);
  EXPECT_EQ(TakeFrame(a).answers_sequence, 4u);
  EXPECT_EQ(TakeFrame(b).answers_sequence, 9u);
  audience_.Contain(b, 10);
  Publish(2);
  EXPECT_EQ(TakeFrame(a).answers_sequence, 4u);
}

TEST_F(AudienceTest, RefersToWhatTheReceiverWasOfferedLast) {
  const int64_t every = AddOnGrid(Delivery::kEvery);
  Publish(1);
  Publish(2);
  Publish(3);
  EXPECT_EQ(TakeFrame(every).frame->reference_revision, std::nullopt);
  EXPECT_EQ(TakeFrame(every).frame->reference_revision, 1u);
  EXPECT_EQ(TakeFrame(every).frame->reference_revision, 2u);
}

TEST_F(AudienceTest, ServesABusyReceiverOnAGridWhenItHasTime) {
  const int64_t slow = AddOnGrid();
  Publish(1);
  TakeFrame(slow);
  for (uint64_t r = 2; r <= 9; ++r) {
    // Nothing is made for it, and it holds nobody up.
    EXPECT_THAT(audience_.Wanted(true, now_), IsEmpty());
    Publish(r);
    EXPECT_FALSE(audience_.NeedsFrame(now_));
  }
  TakeNothing(slow);
  EXPECT_TRUE(audience_.NeedsFrame(now_));
  EXPECT_FALSE(audience_.MustSeeThis(now_));
  Serve(9);
  const FrameToSend sent = TakeFrame(slow);
  EXPECT_EQ(sent.frame->info.revision, 9u);
  EXPECT_EQ(sent.frame->reference_revision, 1u);
  EXPECT_EQ(sent.skipped_revisions, 7u);
}

TEST_F(AudienceTest, ReceiversWithTheSameReferenceShareAFrame) {
  const int64_t quick = AddOnGrid();
  const int64_t other = AddOnGrid();
  const int64_t slow = AddOnGrid();
  Publish(1);
  for (const int64_t seat : {quick, other, slow}) TakeFrame(seat);
  for (const int64_t seat : {quick, other}) TakeNothing(seat);
  Publish(2);
  const auto second = TakeFrame(quick).frame;
  EXPECT_EQ(TakeFrame(other).frame, second);
  for (const int64_t seat : {quick, other}) TakeNothing(seat);
  Publish(3);
  const auto third = TakeFrame(quick).frame;
  EXPECT_EQ(third->reference_revision, 2u);
  EXPECT_EQ(TakeFrame(other).frame, third);
  // Its reference is another by now.
  TakeNothing(slow);
  Serve(3);
  const auto late = TakeFrame(slow).frame;
  EXPECT_EQ(late->reference_revision, 1u);
  EXPECT_EQ(late->info.revision, 3u);
}

TEST_F(AudienceTest, WhoBecomesFreeGetsAFrameThatIsThere) {
  const int64_t quick = AddOnGrid();
  const int64_t slow = AddOnGrid();
  Publish(1);
  for (const int64_t seat : {quick, slow}) TakeFrame(seat);
  TakeNothing(quick);
  Publish(2);
  EXPECT_EQ(TakeFrame(slow).frame, TakeFrame(quick).frame);
}

TEST_F(AudienceTest, AFrameOfFloatsIsNoReference) {
  const int64_t seat = AddOnGrid();
  Publish(1);
  TakeFrame(seat);
  TakeNothing(seat);
  auto floats = std::make_shared<Frame>();
  floats->info.revision = 2;
  audience_.Publish(2, {{audience_.Wanted(true, now_).front(), floats}}, now_);
  EXPECT_EQ(TakeFrame(seat).frame, floats);
  TakeNothing(seat);
  Publish(3);
  EXPECT_EQ(TakeFrame(seat).frame->reference_revision, 1u);
}

TEST_F(AudienceTest, GivesAKeyframeToWhoAsksForOne) {
  const int64_t seat = AddOnGrid();
  Publish(1);
  TakeFrame(seat);
  audience_.WantKeyframe(seat);
  EXPECT_FALSE(audience_.NeedsFrame(now_));  // Not while the last is under way.
  const FrameToSend again = TakeFrame(seat);
  EXPECT_EQ(again.frame->info.revision, 1u);
  EXPECT_EQ(again.frame->reference_revision, std::nullopt);
  EXPECT_EQ(again.skipped_revisions, 0u);
}

TEST_F(AudienceTest, AFrameThatRefersToWhatWasLostIsNotSent) {
  const int64_t seat = AddOnGrid(Delivery::kEvery);
  Publish(1);
  const std::vector<FrameKey> before = audience_.Wanted(true, now_);
  audience_.WantKeyframe(seat);
  audience_.Publish(2, Made(2, before), now_);
  EXPECT_TRUE(audience_.MustSeeThis(now_));
  Serve(2);
  EXPECT_EQ(TakeFrame(seat).frame->info.revision, 1u);
  const FrameToSend sent = TakeFrame(seat);
  EXPECT_EQ(sent.frame->info.revision, 2u);
  EXPECT_EQ(sent.frame->reference_revision, std::nullopt);
}

TEST_F(AudienceTest, GivesNormalsToWhoWantsThemBesideTheSameFrame) {
  const int64_t with =
      audience_.Add({.format = float32_, .normals = true}, {}, now_);
  const int64_t without = Add();
  const auto normals = std::make_shared<const FrameNormals>();
  EXPECT_TRUE(audience_.WantsNormals(true, now_));
  EXPECT_TRUE(audience_.WantsNormals(false, now_));
  audience_.Publish(1, Made(1, audience_.Wanted(true, now_)), now_, normals);
  const FrameToSend sent = TakeFrame(with);
  const FrameToSend other = TakeFrame(without);
  EXPECT_EQ(sent.frame, other.frame);
  EXPECT_EQ(sent.normals, normals);
  EXPECT_EQ(other.normals, nullptr);
}

TEST_F(AudienceTest, NormalsMayComeAfterTheFrame) {
  Add();
  Publish(1);
  EXPECT_FALSE(audience_.WantsNormals(true, now_));
  const int64_t late =
      audience_.Add({.format = float32_, .normals = true}, {}, now_);
  TakeNothing(late);
  EXPECT_TRUE(audience_.NeedsFrame(now_));
  // The frame is there.
  EXPECT_THAT(audience_.Wanted(false, now_), IsEmpty());
  EXPECT_TRUE(audience_.WantsNormals(false, now_));
  const auto normals = std::make_shared<const FrameNormals>();
  audience_.Publish(1, {}, now_, normals);
  EXPECT_EQ(TakeFrame(late).normals, normals);
  // They are there for the next who comes, and only in this revision.
  const int64_t next =
      audience_.Add({.format = float32_, .normals = true}, {}, now_);
  EXPECT_FALSE(audience_.NeedsFrame(now_));
  EXPECT_EQ(TakeFrame(next).normals, normals);
  EXPECT_TRUE(audience_.WantsNormals(true, now_));
}

TEST_F(AudienceTest, WhoWantsFewFramesGetsTheNewestWhenTheIntervalIsOver) {
  for (const FrameFormat& format : {float32_, predicted_}) {
    const int64_t seat = AddLimited(format);
    Publish(1);
    EXPECT_EQ(TakeFrame(seat).frame->info.revision, 1u);
    TakeNothing(seat);
    Pass(60);
    for (const uint64_t r : {2, 3}) {
      // None is made for it, and it holds nobody up.
      EXPECT_THAT(audience_.Wanted(true, now_), IsEmpty());
      Publish(r);
      EXPECT_FALSE(audience_.NeedsFrame(now_));
    }
    TakeNothing(seat);
    Pass(40);
    EXPECT_EQ(audience_.NextDue(), now_);
    EXPECT_TRUE(audience_.NeedsFrame(now_));
    EXPECT_FALSE(audience_.MustSeeThis(now_));
    Serve(3);
    EXPECT_EQ(audience_.NextDue(), std::nullopt);
    const FrameToSend sent = TakeFrame(seat);
    EXPECT_EQ(sent.frame->info.revision, 3u);
    EXPECT_EQ(sent.skipped_revisions, 1u);
    audience_.Remove(seat);
    Publish(0);
  }
}

TEST_F(AudienceTest, WhoWantsFewFramesSharesThoseOfOthers) {
  const int64_t few = AddLimited(float32_);
  const int64_t all = Add();
  Publish(1);
  TakeFrame(few);
  TakeNothing(few);
  Publish(2);
  EXPECT_THAT(audience_.Serve(now_), IsEmpty());
  Pass(100);
  EXPECT_THAT(audience_.Serve(now_), SizeIs(1));
  EXPECT_EQ(TakeFrame(few).frame, TakeFrame(all).frame);
  EXPECT_THAT(audience_.Serve(now_), IsEmpty());
}

TEST_F(AudienceTest, WhoWantsFewFramesGetsNoneWhileOneIsUnderWay) {
  const int64_t few = AddLimited(float32_);
  const int64_t all = Add();
  Publish(1);
  TakeFrame(few);
  Pass(500);
  Publish(2);
  EXPECT_EQ(audience_.NextDue(), std::nullopt);
  Publish(3);
  // Then it is there at once, and the interval begins anew.
  EXPECT_EQ(TakeFrame(few).frame, TakeFrame(all).frame);
  TakeNothing(few);
  Publish(4);
  EXPECT_EQ(audience_.NextDue(), now_ + std::chrono::milliseconds(100));
}

TEST_F(AudienceTest, WhoWantsAllFramesNeverWaitsForTheClock) {
  const int64_t seat = Add(Delivery::kEvery);
  Publish(1);
  Pass(5);
  TakeFrame(seat);
  // A step that has read the clock before the frame was taken.
  Pass(-5);
  Publish(2);
  EXPECT_EQ(TakeFrame(seat).frame->info.revision, 2u);
}

TEST_F(AudienceTest, AFrameOnAnotherRigOrOneThatEndsTheStreamDoesNotWait) {
  const int64_t seat = AddLimited(float32_);
  Publish(1);
  TakeFrame(seat);
  TakeNothing(seat);
  audience_.Announce(nullptr);
  Publish(2);
  EXPECT_TRUE(std::holds_alternative<RigChanged>(*audience_.Take(seat, now_)));
  EXPECT_EQ(TakeFrame(seat).frame->info.revision, 2u);
  TakeNothing(seat);
  Publish(3);
  EXPECT_FALSE(audience_.NeedsFrame(now_));
  audience_.Find(seat)->Expect(1);
  audience_.EndWhenAnswered(absl::OkStatus());
  EXPECT_TRUE(audience_.NeedsFrame(now_));
}

TEST_F(AudienceTest, HasRoomAsLongAsEverybodyHas) {
  const int64_t every = Add(Delivery::kEvery);
  Add(Delivery::kLatest);
  for (uint64_t r = 1; r <= Outbox::kMaxFrames; ++r) {
    EXPECT_TRUE(audience_.HasRoom());
    Publish(r);
  }
  EXPECT_FALSE(audience_.HasRoom());
  EXPECT_FALSE(audience_.HasRoomForRigChange());
  TakeFrame(every);
  EXPECT_TRUE(audience_.HasRoom());
}

TEST_F(AudienceTest, TellsAChangeOfTheRigBeforeItsFirstFrame) {
  const int64_t seat = Add();
  for (size_t i = 0; i < Outbox::kMaxRigChanges; ++i) {
    EXPECT_TRUE(audience_.HasRoomForRigChange());
    audience_.Announce(nullptr);
    Publish(i + 1);
  }
  EXPECT_FALSE(audience_.HasRoomForRigChange());
  EXPECT_TRUE(std::holds_alternative<RigChanged>(*audience_.Take(seat, {})));
  EXPECT_TRUE(audience_.HasRoomForRigChange());
}

TEST_F(AudienceTest, CountsTheWaitFromTheLastProgress) {
  const Audience::TimePoint then{};
  const int64_t seat = Add();
  EXPECT_FALSE(audience_.WaitingSince(seat).has_value());
  Publish(0);
  audience_.Take(seat, then + std::chrono::seconds(1));
  EXPECT_EQ(audience_.WaitingSince(seat), then + std::chrono::seconds(1));
  audience_.Progressed(seat, then + std::chrono::seconds(2));
  EXPECT_EQ(audience_.WaitingSince(seat), then + std::chrono::seconds(2));
  // Nothing is left to be sent: what was taken before has been.
  audience_.Take(seat, then + std::chrono::seconds(3));
  EXPECT_FALSE(audience_.WaitingSince(seat).has_value());
}

TEST_F(AudienceTest, WhoHasLeftGetsNothingAndHoldsNobodyUp) {
  const int64_t seat = Add(Delivery::kEvery);
  for (uint64_t r = 1; r <= Outbox::kMaxFrames; ++r) Publish(r);
  audience_.Remove(seat);
  EXPECT_TRUE(audience_.HasRoom());
  EXPECT_EQ(audience_.size(), 0);
  EXPECT_EQ(audience_.Find(seat), nullptr);
  EXPECT_FALSE(audience_.Take(seat, {}).has_value());
  audience_.Contain(seat, 1);
  audience_.Progressed(seat, {});
  EXPECT_FALSE(audience_.WaitingSince(seat).has_value());
}

TEST_F(AudienceTest, EndsEverybody) {
  const int64_t a = Add();
  const int64_t b = Add(Delivery::kEvery);
  Publish(1);
  audience_.EndNow(absl::NotFoundError("gone"));
  for (const int64_t seat : {a, b}) {
    const auto end = audience_.Take(seat, {});
    EXPECT_EQ(std::get<Ended>(end.value()).status.message(), "gone");
  }
}

}  // namespace
}  // namespace deform::server
