#include "client/cpp/backoff.h"

#include <gtest/gtest.h>

namespace deform {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class BackoffTest : public testing::Test {
 protected:
  std::chrono::steady_clock::time_point now_{};
  Backoff backoff_{seconds(30), [this] { return now_; }, 1};
};

TEST_F(BackoffTest, WaitsTwiceAsLongEachTimeUpToASecond) {
  EXPECT_EQ(backoff_.Next(), milliseconds(0));
  for (int64_t full : {50, 100, 200, 400, 800, 1000, 1000}) {
    const auto wait = backoff_.Next();
    ASSERT_TRUE(wait);
    EXPECT_LE(wait->count(), full);
    EXPECT_GE(wait->count(), full * 3 / 4);
  }
}

TEST_F(BackoffTest, BeginsAnewOnceSomethingHasSucceeded) {
  for (int i = 0; i < 5; ++i) backoff_.Next();
  backoff_.Succeeded();
  EXPECT_EQ(backoff_.Next(), milliseconds(0));
}

TEST_F(BackoffTest, GivesUpWhenPatienceEnds) {
  EXPECT_TRUE(backoff_.Next());
  now_ += milliseconds(29'999);
  EXPECT_TRUE(backoff_.Next());
  now_ += milliseconds(1);
  EXPECT_FALSE(backoff_.Next());
  backoff_.Succeeded();
  EXPECT_TRUE(backoff_.Next());
}

TEST_F(BackoffTest, WithoutPatienceThereIsNoAttempt) {
  Backoff none(
      milliseconds(0), [this] { return now_; }, 1);
  EXPECT_FALSE(none.Next());
}

TEST_F(BackoffTest, ThoseWhoLostTheSameServerDoNotWaitAlike) {
  Backoff other(
      seconds(30), [this] { return now_; }, 2);
  bool differs = false;
  for (int i = 0; i < 8; ++i) differs |= backoff_.Next() != other.Next();
  EXPECT_TRUE(differs);
}

}  // namespace
}  // namespace deform
