#include "server/sessions/audience.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class AudienceTest : public testing::Test {
 protected:
  int64_t Add(Delivery delivery = Delivery::kLatest) {
    return audience_.Add(delivery, float32_, {});
  }
  // A revision in all encodings in use.
  void Publish(uint64_t revision) {
    auto frame = std::make_shared<Frame>();
    frame->info.revision = revision;
    audience_.Publish(revision, {{&float32_, frame}});
  }
  FrameToSend TakeFrame(int64_t seat) {
    return std::get<FrameToSend>(audience_.Take(seat, {}).value());
  }

  const FrameEncoding& float32_ = *FindEncoding("float32");
  const FrameEncoding& quantized16_ = *FindEncoding("quantized16");
  Audience audience_;
};

TEST_F(AudienceTest, GivesWhoComesFirstNothingUntilThereIsAFrame) {
  const int64_t seat = Add();
  EXPECT_TRUE(audience_.NeedsFrame());
  EXPECT_THAT(audience_.Wanted(false), ElementsAre(&float32_));
  EXPECT_FALSE(audience_.Take(seat, {}).has_value());
  Publish(0);
  EXPECT_FALSE(audience_.NeedsFrame());
  EXPECT_THAT(audience_.Wanted(false), IsEmpty());
  EXPECT_EQ(TakeFrame(seat).frame->info.revision, 0u);
}

TEST_F(AudienceTest, GivesWhoComesLaterThePresentFrame) {
  Add();
  Publish(7);
  const int64_t late = Add();
  EXPECT_FALSE(audience_.NeedsFrame());
  EXPECT_EQ(TakeFrame(late).frame->info.revision, 7u);
}

TEST_F(AudienceTest, AsksForAnEncodingThatIsNotThereYet) {
  Add();
  Publish(1);
  const int64_t other = audience_.Add(Delivery::kLatest, quantized16_, {});
  EXPECT_THAT(audience_.Wanted(false), ElementsAre(&quantized16_));
  // As if it had come while the next revision was encoded.
  Publish(2);
  EXPECT_TRUE(audience_.NeedsFrame());
  auto frame = std::make_shared<Frame>();
  frame->info.revision = 2;
  audience_.Publish(2, {{&quantized16_, frame}});
  EXPECT_FALSE(audience_.NeedsFrame());
  EXPECT_EQ(TakeFrame(other).frame, frame);
}

TEST_F(AudienceTest, WantsEachEncodingOnce) {
  Add();
  Add();
  EXPECT_THAT(audience_.Wanted(true), ElementsAre(&float32_));
}

TEST_F(AudienceTest, PublishingARevisionAgainSendsItOnce) {
  const int64_t seat = Add();
  Publish(1);
  Publish(1);
  TakeFrame(seat);
  EXPECT_FALSE(audience_.Take(seat, {}).has_value());
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
