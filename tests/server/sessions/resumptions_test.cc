#include "server/sessions/resumptions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace deform::server {
namespace {

using std::chrono::seconds;

class ResumptionsTest : public testing::Test {
 protected:
  void Keep(const std::string& key, int64_t participant) {
    places_.Keep(key, {.participant = participant, .last_sequence = 7}, now_);
  }

  Resumptions places_{3, seconds(60)};
  Resumptions::TimePoint now_{seconds(1000)};
};

TEST_F(ResumptionsTest, GivesAPlaceBackOnce) {
  Keep("a", 1);
  Keep("b", 2);
  const auto place = places_.Take("a", now_);
  ASSERT_TRUE(place);
  EXPECT_EQ(place->participant, 1);
  EXPECT_EQ(place->last_sequence, 7u);
  EXPECT_FALSE(places_.Take("a", now_));
  EXPECT_FALSE(places_.Take("c", now_));
  EXPECT_TRUE(places_.Take("b", now_));
}

TEST_F(ResumptionsTest, KeepsItForTheGraceTime) {
  Keep("a", 1);
  now_ += seconds(30);
  Keep("b", 2);
  now_ += seconds(30);
  EXPECT_FALSE(places_.Take("a", now_));
  EXPECT_TRUE(places_.Take("b", now_));
  EXPECT_EQ(places_.size(), 0u);
}

TEST_F(ResumptionsTest, TheOldestGoWhenThereAreMoreThanMayBe) {
  for (int64_t i = 1; i <= 5; ++i) {
    now_ += seconds(1);
    Keep(std::string(1, static_cast<char>('a' + i)), i);
  }
  EXPECT_EQ(places_.size(), 3u);
  EXPECT_EQ(places_.Find(2), nullptr);
  ASSERT_NE(places_.Find(3), nullptr);
  EXPECT_EQ(places_.Find(5)->participant, 5);
}

TEST_F(ResumptionsTest, WhatIsAnsweredMeanwhileIsKnown) {
  Keep("a", 1);
  places_.Find(1)->contained = 6;
  EXPECT_EQ(places_.Take("a", now_)->contained, 6u);
}

TEST(ResumeToken, NoTwoAreAlike) {
  std::set<std::string> tokens;
  for (int i = 0; i < 1000; ++i) tokens.insert(MakeResumeToken().value());
  EXPECT_EQ(tokens.size(), 1000u);
  EXPECT_EQ(tokens.begin()->size(), 32u);
}

TEST(ResumeToken, ItsKeyIsANameThatDoesNotTellIt) {
  const std::string token = MakeResumeToken().value();
  const std::string key = ResumeKeyOf(token);
  EXPECT_EQ(key, ResumeKeyOf(token));
  EXPECT_NE(key, ResumeKeyOf(MakeResumeToken().value()));
  EXPECT_EQ(key.size(), 40u);
  EXPECT_EQ(key.find(token), std::string::npos);
}

}  // namespace
}  // namespace deform::server
