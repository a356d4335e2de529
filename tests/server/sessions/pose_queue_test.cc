#include "server/sessions/pose_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace deform::server {
namespace {

constexpr bool kOwn = true;
constexpr bool kMerge = false;

PoseUpdate Move(int32_t vertex, double x) {
  Positions to = Positions::Zero(1, 3);
  to(0, 0) = x;
  return {.vertices = {vertex}, .positions = to};
}

Pose AtRest() { return {.vertices = Positions::Zero(3, 3)}; }

TEST(PoseQueue, IsEmptyAtFirst) {
  PoseQueue queue(AtRest());
  EXPECT_TRUE(queue.empty());
  EXPECT_FALSE(queue.Pop().has_value());
}

TEST(PoseQueue, MergesDifferentVertices) {
  PoseQueue queue(AtRest());
  queue.Push({.participant = 1, .sequence = 1}, Move(0, 5), kMerge);
  queue.Push({.participant = 2, .sequence = 1}, Move(2, 7), kMerge);
  const auto step = queue.Pop();
  EXPECT_EQ(step->pose.vertices.col(0), Eigen::Vector3d(5, 0, 7));
  EXPECT_EQ(step->answers.size(), 2u);
  EXPECT_TRUE(queue.empty());
}

TEST(PoseQueue, KeepsOnlyTheNewestPlaceOfAVertex) {
  PoseQueue queue(AtRest());
  for (uint64_t i = 1; i <= 9; ++i) {
    queue.Push({.participant = 1, .sequence = i}, Move(1, 10.0 * i), kMerge);
  }
  const auto step = queue.Pop();
  EXPECT_EQ(step->pose.vertices(1, 0), 90);
  ASSERT_EQ(step->answers.size(), 1u);
  EXPECT_EQ(step->answers[0].sequence, 9u);
  EXPECT_TRUE(queue.empty());
}

TEST(PoseQueue, StartsFromWhatWasPopped) {
  PoseQueue queue(AtRest());
  queue.Push({.participant = 1, .sequence = 1}, Move(0, 5), kMerge);
  queue.Pop();
  queue.Push({.participant = 1, .sequence = 2}, Move(1, 6), kMerge);
  EXPECT_EQ(queue.Pop()->pose.vertices.col(0), Eigen::Vector3d(5, 6, 0));
}

TEST(PoseQueue, KeepsPosesApartThatAskForIt) {
  PoseQueue queue(AtRest());
  queue.Push({.participant = 1, .sequence = 1}, Move(0, 1), kOwn);
  queue.Push({.participant = 1, .sequence = 2}, Move(0, 2), kOwn);
  EXPECT_EQ(queue.OwnStepsOf(1), 2);
  EXPECT_EQ(queue.OwnStepsOf(2), 0);
  EXPECT_EQ(queue.Pop()->pose.vertices(0, 0), 1);
  EXPECT_EQ(queue.Pop()->pose.vertices(0, 0), 2);
}

TEST(PoseQueue, TheLastWriterWinsAcrossBothKinds) {
  PoseQueue queue(AtRest());
  queue.Push({.participant = 1, .sequence = 1}, Move(0, 1), kMerge);
  queue.Push({.participant = 2, .sequence = 1}, Move(0, 2), kOwn);
  queue.Push({.participant = 1, .sequence = 2}, Move(0, 3), kMerge);
  queue.Push({.participant = 1, .sequence = 3}, Move(1, 4), kMerge);
  EXPECT_EQ(queue.Pop()->pose.vertices(0, 0), 1);
  EXPECT_EQ(queue.Pop()->pose.vertices(0, 0), 2);
  const auto last = queue.Pop();
  EXPECT_EQ(last->pose.vertices.col(0), Eigen::Vector3d(3, 4, 0));
  EXPECT_EQ(last->answers[0].sequence, 3u);
  EXPECT_TRUE(queue.empty());
}

TEST(PoseQueue, KeepsTheBlendUntilItChanges) {
  PoseQueue queue(AtRest());
  queue.Push({.participant = 1, .sequence = 1}, {.stretch_blend = 0.25},
             kMerge);
  queue.Pop();
  queue.Push({.participant = 1, .sequence = 2}, Move(0, 1), kMerge);
  EXPECT_EQ(queue.Pop()->pose.stretch_blend, 0.25);
}

}  // namespace
}  // namespace deform::server
