#include "client/cpp/unanswered.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/base/error.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

v1::DeformRequest Pose(uint64_t sequence, uint64_t rig_changes = 0) {
  v1::DeformRequest request;
  request.mutable_pose()->set_sequence(sequence);
  request.mutable_pose()->set_rig_changes(rig_changes);
  return request;
}

class UnansweredTest : public testing::Test {
 protected:
  void Add(uint64_t first, uint64_t last) {
    for (uint64_t i = first; i <= last; ++i) {
      ASSERT_TRUE(waiting_.Add(i, Pose(i)).ok());
    }
  }
  // Sends all there is; the sequences.
  std::vector<uint64_t> SendAll() {
    std::vector<uint64_t> sent;
    while (const auto request = waiting_.TakeUnsent()) {
      sent.push_back(request->pose().sequence());
    }
    return sent;
  }

  Unanswered waiting_;
};

TEST_F(UnansweredTest, SendsEachOnce) {
  Add(1, 3);
  EXPECT_THAT(SendAll(), ElementsAre(1, 2, 3));
  EXPECT_THAT(SendAll(), IsEmpty());
  Add(4, 4);
  EXPECT_THAT(SendAll(), ElementsAre(4));
  EXPECT_EQ(waiting_.size(), 4u);
}

TEST_F(UnansweredTest, ForgetsWhatWasAnswered) {
  Add(1, 5);
  SendAll();
  EXPECT_EQ(waiting_.answered_up_to(), 0u);
  EXPECT_TRUE(waiting_.Answered(4));
  EXPECT_FALSE(waiting_.Answered(4));
  waiting_.AnsweredUpTo(2, 1);
  EXPECT_EQ(waiting_.answered_up_to(), 2u);
  EXPECT_EQ(waiting_.size(), 2u);
  waiting_.AnsweredUpTo(5, 1);
  EXPECT_EQ(waiting_.answered_up_to(), 5u);
  EXPECT_EQ(waiting_.size(), 0u);
}

TEST_F(UnansweredTest, SendsAgainWhatWasNotAccepted) {
  Add(1, 5);
  SendAll();
  Add(6, 6);
  waiting_.AnsweredUpTo(1, 1);
  waiting_.Rejoined(3, false);
  EXPECT_THAT(SendAll(), ElementsAre(4, 5, 6));
  waiting_.AnsweredUpTo(3, 1);
  EXPECT_EQ(waiting_.size(), 3u);
  waiting_.Rejoined(0, false);
  EXPECT_THAT(SendAll(), ElementsAre(4, 5, 6));
}

TEST_F(UnansweredTest, SendsAgainWhatAServerAnsweredAndLost) {
  Add(1, 6);
  SendAll();
  waiting_.AnsweredUpTo(2, 10);
  waiting_.AnsweredUpTo(5, 11);
  waiting_.DurableUpTo(10);
  // The same server has all that it answered.
  waiting_.Rejoined(6, false);
  EXPECT_THAT(SendAll(), IsEmpty());
  // The next has more than was known to be durable, and less than was answered.
  waiting_.Rejoined(4, true);
  EXPECT_EQ(waiting_.answered_up_to(), 4u);
  EXPECT_THAT(SendAll(), ElementsAre(5, 6));
  // What it has is not kept for one that follows.
  waiting_.Rejoined(0, true);
  EXPECT_THAT(SendAll(), ElementsAre(5, 6));
}

TEST_F(UnansweredTest, SendsNothingAgainThatIsDurable) {
  Add(1, 3);
  SendAll();
  waiting_.AnsweredUpTo(3, 7);
  waiting_.DurableUpTo(7);
  waiting_.Rejoined(0, true);
  EXPECT_THAT(SendAll(), IsEmpty());
}

TEST_F(UnansweredTest, KeepsTheLastAnswersWhereNothingBecomesDurable) {
  const uint64_t count = Unanswered::kMaxAnswered + 10;
  for (uint64_t i = 1; i <= count; ++i) {
    Add(i, i);
    SendAll();
    waiting_.AnsweredUpTo(i, i);
  }
  EXPECT_EQ(waiting_.size(), 0u);
  waiting_.Rejoined(0, true);
  EXPECT_EQ(waiting_.size(), Unanswered::kMaxAnswered);
  EXPECT_EQ(waiting_.answered_up_to(), 10u);
}

TEST_F(UnansweredTest, WhatIsNotSentIsNotAnswered) {
  Add(1, 2);
  waiting_.AnsweredUpTo(2, 1);
  EXPECT_FALSE(waiting_.Answered(1));
  EXPECT_THAT(SendAll(), ElementsAre(1, 2));
}

TEST_F(UnansweredTest, WhatWantsNoAnswerIsForgotten) {
  Add(1, 1);
  ASSERT_TRUE(waiting_.Add(0, Pose(0)).ok());
  Add(2, 2);
  EXPECT_THAT(SendAll(), ElementsAre(1, 0, 2));
  EXPECT_EQ(waiting_.size(), 2u);
  ASSERT_TRUE(waiting_.Add(0, Pose(0)).ok());
  waiting_.Rejoined(1, false);
  EXPECT_THAT(SendAll(), ElementsAre(2));
}

TEST_F(UnansweredTest, IsBounded) {
  Add(1, Unanswered::kMaxRequests);
  absl::Status full = waiting_.Add(Unanswered::kMaxRequests + 1, Pose(1));
  EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(DetailOf(full).reason, "UNANSWERED_LIMIT");
  EXPECT_THAT(std::string(full.message()), HasSubstr("4096 requests"));
  SendAll();
  waiting_.AnsweredUpTo(1, 1);
  EXPECT_TRUE(waiting_.Add(Unanswered::kMaxRequests + 1, Pose(1)).ok());

  Unanswered large;
  v1::DeformRequest big;
  big.mutable_pose()->mutable_positions()->Resize(2'500'000, 1);
  uint64_t count = 0;
  while (large.Add(count + 1, big).ok()) ++count;
  EXPECT_EQ(count, 3u);
}

TEST_F(UnansweredTest, CountsRigChangesFromAnotherBeginning) {
  ASSERT_TRUE(waiting_.Add(1, Pose(1, 2)).ok());
  ASSERT_TRUE(waiting_.Add(2, Pose(2, 3)).ok());
  EXPECT_TRUE(waiting_.CountRigChangesFrom(2));
  EXPECT_EQ(waiting_.TakeUnsent()->pose().rig_changes(), 0u);
  EXPECT_EQ(waiting_.TakeUnsent()->pose().rig_changes(), 1u);
  EXPECT_FALSE(waiting_.CountRigChangesFrom(1));
}

}  // namespace
}  // namespace deform
