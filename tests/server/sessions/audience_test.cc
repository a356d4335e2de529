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
  int64_t AddOnGrid(Delivery delivery = Delivery::kLatest) {
    return audience_.Add(delivery, predicted_, {});
  }
  // Makes what is wanted of the revision.
  Frames Made(uint64_t revision, const std::vector<FrameKey>& keys) {
    Frames frames;
    std::shared_ptr<const RevisionGrid> grid;
    for (const FrameKey& key : keys) {
      auto frame = std::make_shared<Frame>();
      frame->info.revision = revision;
      if (key.format.encoding->uses_grid()) {
        if (grid == nullptr) {
          grid = std::make_shared<const RevisionGrid>(
              RevisionGrid{.revision = revision, .grid = Grid(1)});
        }
        frame->grid = grid;
        if (key.reference) {
          frame->reference_revision = key.reference->revision;
        }
      }
      frames[key] = std::move(frame);
    }
    return frames;
  }
  void Publish(uint64_t revision) {
    audience_.Publish(revision, Made(revision, audience_.Wanted(true)));
  }
  // Frames of the revision for those who lack one.
  void Serve(uint64_t revision) {
    audience_.Publish(revision, Made(revision, audience_.Wanted(false)));
  }
  FrameToSend TakeFrame(int64_t seat) {
    return std::get<FrameToSend>(audience_.Take(seat, {}).value());
  }
  // It has been sent.
  void TakeNothing(int64_t seat) {
    EXPECT_FALSE(audience_.Take(seat, {}).has_value());
  }

  const FrameFormat float32_{.encoding = FindEncoding("float32")};
  const FrameFormat quantized16_{.encoding = FindEncoding("quantized16"),
                                 .tolerance = 0.1};
  const FrameFormat predicted_{.encoding = FindEncoding("predicted"),
                               .tolerance = 0.1};
  Audience audience_;
};

TEST_F(AudienceTest, GivesWhoComesFirstNothingUntilThereIsAFrame) {
  const int64_t seat = Add();
  EXPECT_TRUE(audience_.NeedsFrame());
  EXPECT_TRUE(audience_.MustSeeThis());
  EXPECT_THAT(audience_.Wanted(false), ElementsAre(FrameKey{float32_}));
  TakeNothing(seat);
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

TEST_F(AudienceTest, AsksForAFormatThatIsNotThereYet) {
  Add();
  Publish(1);
  const std::vector<FrameKey> before = audience_.Wanted(true);
  const int64_t other = audience_.Add(Delivery::kLatest, quantized16_, {});
  EXPECT_THAT(audience_.Wanted(false), ElementsAre(FrameKey{quantized16_}));
  // It has come while the next revision was encoded.
  audience_.Publish(2, Made(2, before));
  EXPECT_TRUE(audience_.MustSeeThis());
  Serve(2);
  EXPECT_FALSE(audience_.NeedsFrame());
  EXPECT_EQ(TakeFrame(other).frame->info.revision, 2u);
}

TEST_F(AudienceTest, WantsEachFrameOnce) {
  Add();
  Add();
  EXPECT_THAT(audience_.Wanted(true), ElementsAre(FrameKey{float32_}));
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
    EXPECT_THAT(audience_.Wanted(true), IsEmpty());
    Publish(r);
    EXPECT_FALSE(audience_.NeedsFrame());
  }
  TakeNothing(slow);
  EXPECT_TRUE(audience_.NeedsFrame());
  EXPECT_FALSE(audience_.MustSeeThis());
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
  EXPECT_EQ(TakeFrame(quick).frame, TakeFrame(other).frame);
  for (const int64_t seat : {quick, other, slow}) TakeNothing(seat);
  Publish(3);
  const auto predicted = TakeFrame(quick).frame;
  const auto late = TakeFrame(slow).frame;
  EXPECT_EQ(predicted->reference_revision, 2u);
  EXPECT_EQ(late->reference_revision, 1u);
  EXPECT_EQ(TakeFrame(other).frame, predicted);
  EXPECT_EQ(late->grid, predicted->grid);
}

TEST_F(AudienceTest, AFrameOfFloatsIsNoReference) {
  const int64_t seat = AddOnGrid();
  Publish(1);
  TakeFrame(seat);
  TakeNothing(seat);
  auto floats = std::make_shared<Frame>();
  floats->info.revision = 2;
  audience_.Publish(2, {{audience_.Wanted(true).front(), floats}});
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
  EXPECT_FALSE(audience_.NeedsFrame());  // Not while the last is under way.
  TakeNothing(seat);
  EXPECT_TRUE(audience_.NeedsFrame());
  Serve(1);
  const FrameToSend again = TakeFrame(seat);
  EXPECT_EQ(again.frame->info.revision, 1u);
  EXPECT_EQ(again.frame->reference_revision, std::nullopt);
  EXPECT_EQ(again.skipped_revisions, 0u);
}

TEST_F(AudienceTest, AFrameThatRefersToWhatWasLostIsNotSent) {
  const int64_t seat = AddOnGrid(Delivery::kEvery);
  Publish(1);
  const std::vector<FrameKey> before = audience_.Wanted(true);
  audience_.WantKeyframe(seat);
  audience_.Publish(2, Made(2, before));
  EXPECT_TRUE(audience_.MustSeeThis());
  Serve(2);
  EXPECT_EQ(TakeFrame(seat).frame->info.revision, 1u);
  const FrameToSend sent = TakeFrame(seat);
  EXPECT_EQ(sent.frame->info.revision, 2u);
  EXPECT_EQ(sent.frame->reference_revision, std::nullopt);
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
