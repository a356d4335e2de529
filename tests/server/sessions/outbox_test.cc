#include "server/sessions/outbox.h"

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace deform::server {
namespace {

std::shared_ptr<const Frame> FrameOf(uint64_t revision, uint64_t origin = 1) {
  auto frame = std::make_shared<Frame>();
  frame->info.revision = revision;
  frame->info.origin_number = origin;
  return frame;
}

FrameToSend TakeFrame(Outbox& outbox) {
  return std::get<FrameToSend>(outbox.Take().value());
}
absl::Status TakeEnd(Outbox& outbox) {
  return std::get<Ended>(outbox.Take().value()).status;
}

TEST(LatestOutbox, KeepsOnlyTheNewestFrame) {
  Outbox outbox(Delivery::kLatest);
  for (uint64_t r = 0; r < 10; ++r) outbox.Offer(FrameOf(r), r);
  const FrameToSend sent = TakeFrame(outbox);
  EXPECT_EQ(sent.frame->info.revision, 9u);
  EXPECT_EQ(sent.answers_sequence, 9u);
  EXPECT_FALSE(outbox.Take().has_value());
  EXPECT_FALSE(outbox.full());
}

TEST(LatestOutbox, CountsTheRevisionsItSkipped) {
  Outbox outbox(Delivery::kLatest);
  outbox.Offer(FrameOf(5), 0);
  EXPECT_EQ(TakeFrame(outbox).skipped_revisions, 0u);
  outbox.Offer(FrameOf(6), 0);
  outbox.Offer(FrameOf(7), 0);
  outbox.Offer(FrameOf(8), 0);
  EXPECT_EQ(TakeFrame(outbox).skipped_revisions, 2u);
  outbox.Offer(FrameOf(9), 0);
  EXPECT_EQ(TakeFrame(outbox).skipped_revisions, 0u);
}

TEST(LatestOutbox, TellsEveryChangeOfTheRigBeforeTheNewestFrame) {
  Outbox outbox(Delivery::kLatest);
  outbox.Offer(FrameOf(0), 0);
  for (uint64_t r = 1; r <= Outbox::kMaxRigChanges; ++r) {
    EXPECT_TRUE(outbox.has_room_for_rig_changes());
    outbox.Announce(nullptr);
    outbox.Offer(FrameOf(r), 0);
  }
  EXPECT_FALSE(outbox.has_room_for_rig_changes());
  for (size_t i = 0; i < Outbox::kMaxRigChanges; ++i) {
    EXPECT_TRUE(std::holds_alternative<RigChanged>(outbox.Take().value()));
  }
  EXPECT_EQ(TakeFrame(outbox).frame->info.revision, Outbox::kMaxRigChanges);
}

TEST(EveryOutbox, TellsAChangeOfTheRigBetweenTheFrames) {
  Outbox outbox(Delivery::kEvery);
  outbox.Offer(FrameOf(0), 0);
  outbox.Announce(nullptr);
  outbox.Offer(FrameOf(1), 0);
  EXPECT_EQ(TakeFrame(outbox).frame->info.revision, 0u);
  EXPECT_TRUE(std::holds_alternative<RigChanged>(outbox.Take().value()));
  EXPECT_EQ(TakeFrame(outbox).frame->info.revision, 1u);
}

TEST(EveryOutbox, KeepsAllFramesInOrderAndSaysWhenItIsFull) {
  Outbox outbox(Delivery::kEvery);
  for (uint64_t r = 0; r < Outbox::kMaxFrames; ++r) {
    EXPECT_FALSE(outbox.full());
    outbox.Offer(FrameOf(r), r);
  }
  EXPECT_TRUE(outbox.full());
  for (uint64_t r = 0; r < Outbox::kMaxFrames; ++r) {
    const FrameToSend sent = TakeFrame(outbox);
    EXPECT_EQ(sent.frame->info.revision, r);
    EXPECT_EQ(sent.skipped_revisions, 0u);
    EXPECT_FALSE(outbox.full());
  }
}

TEST(Outbox, TellsAnOriginOnce) {
  Outbox outbox(Delivery::kEvery);
  outbox.Offer(FrameOf(0, 1), 0);
  outbox.Offer(FrameOf(1, 1), 0);
  outbox.Offer(FrameOf(2, 2), 0);
  outbox.Offer(FrameOf(3, 2), 0);
  EXPECT_TRUE(TakeFrame(outbox).tells_origin);
  EXPECT_FALSE(TakeFrame(outbox).tells_origin);
  EXPECT_TRUE(TakeFrame(outbox).tells_origin);
  EXPECT_FALSE(TakeFrame(outbox).tells_origin);
}

TEST(Outbox, TellsABasisWhenItIsAnother) {
  Outbox outbox(Delivery::kEvery);
  const auto offer = [&](const std::string& basis_id) {
    auto frame = std::make_shared<Frame>();
    frame->info.basis_id = basis_id;
    outbox.Offer(std::move(frame), 0);
    return TakeFrame(outbox).tells_basis;
  };
  EXPECT_FALSE(offer(""));
  EXPECT_TRUE(offer("a"));
  EXPECT_FALSE(offer("a"));
  EXPECT_TRUE(offer("b"));
  EXPECT_TRUE(offer(""));
}

TEST(Outbox, TellsTheOriginAlsoWhenItsFirstFrameWasSkipped) {
  Outbox outbox(Delivery::kLatest);
  outbox.Offer(FrameOf(0, 1), 0);
  TakeFrame(outbox);
  outbox.Offer(FrameOf(1, 2), 0);
  outbox.Offer(FrameOf(2, 2), 0);
  EXPECT_TRUE(TakeFrame(outbox).tells_origin);
}

TEST(Outbox, TellsTheOrderOfPointsOnceBeforeTheFirstFrameOnAGrid) {
  Outbox outbox(Delivery::kEvery);
  auto on_grid = std::make_shared<Frame>();
  on_grid->info.revision = 1;
  on_grid->order =
      std::make_shared<const PointOrder>(Positions(Positions::Zero(1, 3)));
  outbox.Offer(FrameOf(0), 0);
  outbox.Offer(on_grid, 0);
  outbox.Offer(on_grid, 0);
  TakeFrame(outbox);
  EXPECT_EQ(std::get<OrderToSend>(outbox.Take().value()).order, on_grid->order);
  TakeFrame(outbox);
  TakeFrame(outbox);
}

TEST(Outbox, ARevisionThatComesAgainSkipsNone) {
  Outbox outbox(Delivery::kLatest);
  for (int i = 0; i < 2; ++i) {
    outbox.Offer(FrameOf(7), 0);
    EXPECT_EQ(TakeFrame(outbox).skipped_revisions, 0u);
  }
}

TEST(Outbox, SendsRejectionsBeforeFrames) {
  Outbox outbox(Delivery::kLatest);
  outbox.Offer(FrameOf(0), 0);
  outbox.Reject(7, absl::InvalidArgumentError("bad"));
  const auto rejection = std::get<Rejection>(outbox.Take().value());
  EXPECT_EQ(rejection.sequence, 7u);
  EXPECT_EQ(rejection.status.message(), "bad");
  TakeFrame(outbox);
}

TEST(Outbox, HasRoomForAFewRejections) {
  Outbox outbox(Delivery::kLatest);
  for (size_t i = 0; i < Outbox::kMaxNotices; ++i) {
    EXPECT_TRUE(outbox.has_room_for_notices());
    outbox.Reject(i, absl::InvalidArgumentError("bad"));
  }
  EXPECT_FALSE(outbox.has_room_for_notices());
  outbox.Take();
  EXPECT_TRUE(outbox.has_room_for_notices());
}

TEST(Outbox, EndsWhenTheLastPoseIsAnswered) {
  Outbox outbox(Delivery::kLatest);
  outbox.Expect(3);
  outbox.EndWhenAnswered(absl::OkStatus());
  outbox.Offer(FrameOf(0), 0);
  TakeFrame(outbox);
  EXPECT_FALSE(outbox.Take().has_value());
  outbox.Offer(FrameOf(1), 2);
  TakeFrame(outbox);
  outbox.Offer(FrameOf(2), 3);
  TakeFrame(outbox);
  EXPECT_TRUE(TakeEnd(outbox).ok());
  EXPECT_FALSE(outbox.Take().has_value());
}

TEST(Outbox, DoesNotEndBeforeTheFirstFrame) {
  Outbox outbox(Delivery::kLatest);
  outbox.EndWhenAnswered(absl::OkStatus());
  EXPECT_FALSE(outbox.Take().has_value());
  outbox.Offer(FrameOf(0), 0);
  TakeFrame(outbox);
  EXPECT_TRUE(TakeEnd(outbox).ok());
}

TEST(Outbox, TellsRejectionsBeforeItEnds) {
  Outbox outbox(Delivery::kLatest);
  outbox.Offer(FrameOf(0), 0);
  TakeFrame(outbox);
  outbox.Reject(1, absl::InvalidArgumentError("bad"));
  outbox.EndWhenAnswered(absl::OkStatus());
  EXPECT_TRUE(std::holds_alternative<Rejection>(outbox.Take().value()));
  EXPECT_TRUE(TakeEnd(outbox).ok());
}

TEST(Outbox, EndingNowDropsWhatWaits) {
  Outbox outbox(Delivery::kEvery);
  outbox.Expect(9);
  outbox.Offer(FrameOf(0), 0);
  outbox.Offer(FrameOf(1), 0);
  outbox.EndNow(absl::NotFoundError("deleted"));
  EXPECT_EQ(TakeEnd(outbox).message(), "deleted");
  EXPECT_FALSE(outbox.Take().has_value());
}

}  // namespace
}  // namespace deform::server
