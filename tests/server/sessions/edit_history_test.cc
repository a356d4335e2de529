#include "server/sessions/edit_history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using Direction = EditHistory::Direction;
using testing::ElementsAre;
using testing::IsEmpty;

PoseUpdate Put(int32_t vertex, double x) {
  return MoveVertex(vertex, {x, 0, 0});
}

// Four vertices on the x axis, all at 0.
class EditHistoryTest : public testing::Test {
 protected:
  void Edit(uint64_t number, const PoseUpdate& update) {
    history_.Record(number, update, pose_);
    ApplyPoseUpdate(update, pose_);
  }
  // By somebody else.
  void Overwrite(int32_t vertex, double x) {
    ApplyPoseUpdate(Put(vertex, x), pose_);
  }
  EditHistory::Reversal Do(Direction direction) {
    const auto reversal = history_.Plan(direction, pose_);
    if (!reversal) {
      ADD_FAILURE() << "nothing to reverse";
      return {};
    }
    ApplyPoseUpdate(reversal->update, pose_);
    history_.Advance(direction);
    return *reversal;
  }
  bool CanDo(Direction direction) const {
    return history_.Plan(direction, pose_).has_value();
  }
  std::vector<double> Xs() const {
    return {pose_.vertices(0, 0), pose_.vertices(1, 0), pose_.vertices(2, 0),
            pose_.vertices(3, 0)};
  }

  EditHistory history_;
  Pose pose_{.vertices = Positions::Zero(4, 3)};
};

TEST_F(EditHistoryTest, UndoesAndRedoesInOrder) {
  Edit(1, Put(0, 1));
  Edit(2, Put(1, 2));
  EXPECT_EQ(Do(Direction::kUndo).edit, 2u);
  EXPECT_THAT(Xs(), ElementsAre(1, 0, 0, 0));
  EXPECT_EQ(Do(Direction::kUndo).edit, 1u);
  EXPECT_THAT(Xs(), ElementsAre(0, 0, 0, 0));
  EXPECT_FALSE(CanDo(Direction::kUndo));
  EXPECT_EQ(Do(Direction::kRedo).edit, 1u);
  EXPECT_EQ(Do(Direction::kRedo).edit, 2u);
  EXPECT_THAT(Xs(), ElementsAre(1, 2, 0, 0));
  EXPECT_FALSE(CanDo(Direction::kRedo));
}

TEST_F(EditHistoryTest, ADragIsOneEdit) {
  for (int i = 1; i <= 60; ++i) Edit(7, Put(2, i));
  Edit(7, Put(3, 5));
  Do(Direction::kUndo);
  EXPECT_THAT(Xs(), ElementsAre(0, 0, 0, 0));
  EXPECT_FALSE(CanDo(Direction::kUndo));
  Do(Direction::kRedo);
  EXPECT_THAT(Xs(), ElementsAre(0, 0, 60, 5));
}

TEST_F(EditHistoryTest, LeavesOutWhatOthersWroteSince) {
  PoseUpdate all{.positions = Positions::Ones(4, 3)};
  Edit(1, all);
  Overwrite(1, 9);
  Overwrite(3, 8);
  EXPECT_THAT(Do(Direction::kUndo).left_out, ElementsAre(1, 3));
  EXPECT_THAT(Xs(), ElementsAre(0, 9, 0, 8));
  EXPECT_THAT(Do(Direction::kRedo).left_out, ElementsAre(1, 3));
  EXPECT_THAT(Xs(), ElementsAre(1, 9, 1, 8));
}

TEST_F(EditHistoryTest, WritesNothingIfOthersWroteAllOfIt) {
  Edit(1, Put(0, 1));
  Overwrite(0, 2);
  const auto reversal = Do(Direction::kUndo);
  EXPECT_TRUE(reversal.nothing());
  EXPECT_THAT(reversal.left_out, ElementsAre(0));
  EXPECT_THAT(Xs(), ElementsAre(2, 0, 0, 0));
}

TEST_F(EditHistoryTest, WhatOthersWroteWithinADragIsWhatItUndoesTo) {
  Edit(1, Put(0, 1));
  Overwrite(0, 7);
  Edit(1, Put(0, 2));
  EXPECT_THAT(Do(Direction::kUndo).left_out, IsEmpty());
  EXPECT_THAT(Xs(), ElementsAre(7, 0, 0, 0));
}

TEST_F(EditHistoryTest, AVertexNamedTwiceTakesItsLastPlace) {
  PoseUpdate twice{.vertices = {0, 0}, .positions = Positions::Zero(2, 3)};
  twice.positions(0, 0) = 1;
  twice.positions(1, 0) = 2;
  Edit(1, Put(0, 5));
  Edit(1, twice);
  EXPECT_THAT(Do(Direction::kUndo).left_out, IsEmpty());
  EXPECT_THAT(Xs(), ElementsAre(0, 0, 0, 0));
  Do(Direction::kRedo);
  EXPECT_THAT(Xs(), ElementsAre(2, 0, 0, 0));
}

TEST_F(EditHistoryTest, ANewEditForgetsWhatWasUndone) {
  Edit(1, Put(0, 1));
  Do(Direction::kUndo);
  // Of the same number, but after something else: an edit of its own.
  Edit(1, Put(1, 2));
  EXPECT_FALSE(CanDo(Direction::kRedo));
  Do(Direction::kUndo);
  EXPECT_THAT(Xs(), ElementsAre(0, 0, 0, 0));
  EXPECT_FALSE(CanDo(Direction::kUndo));
}

TEST_F(EditHistoryTest, CoversTheStretchBlend) {
  Edit(1, {.stretch_blend = 0.5});
  Edit(1, {.stretch_blend = 0.25});
  Edit(2, Put(0, 1));
  Do(Direction::kUndo);
  EXPECT_EQ(pose_.stretch_blend, 0.25);
  Do(Direction::kUndo);
  EXPECT_EQ(pose_.stretch_blend, 1);
  Do(Direction::kRedo);
  EXPECT_EQ(pose_.stretch_blend, 0.25);
  pose_.stretch_blend = 0.75;
  EXPECT_TRUE(Do(Direction::kUndo).nothing());
}

TEST_F(EditHistoryTest, KeepsTheNewestEdits) {
  for (uint64_t i = 1; i <= EditHistory::kMaxEdits + 3; ++i) {
    Edit(i, Put(0, static_cast<double>(i)));
  }
  size_t undone = 0;
  for (; CanDo(Direction::kUndo); ++undone) Do(Direction::kUndo);
  EXPECT_EQ(undone, EditHistory::kMaxEdits);
  EXPECT_THAT(Xs(), ElementsAre(3, 0, 0, 0));
}

TEST_F(EditHistoryTest, KeepsNoMoreVerticesThanMayBeButTheNewestEdit) {
  constexpr int64_t kHalf = EditHistory::kMaxVertices / 2;
  pose_.vertices = Positions::Zero(3 * kHalf, 3);
  const auto edit = [&](uint64_t number, int64_t rows) {
    Edit(number, {.positions = Positions::Constant(
                      rows, 3, static_cast<double>(number))});
  };
  const auto count = [&] {
    size_t edits = 0;
    for (; CanDo(Direction::kUndo); ++edits) Do(Direction::kUndo);
    return edits;
  };
  edit(1, kHalf);
  edit(2, kHalf);
  EXPECT_EQ(count(), 2u);
  edit(3, kHalf);
  edit(4, kHalf);
  edit(5, 1);
  EXPECT_EQ(count(), 2u);
  edit(6, kHalf);
  edit(7, 3 * kHalf);
  EXPECT_EQ(count(), 1u);
}

// Handles that move at rest shift in poses, removed ones are forgotten.
TEST_F(EditHistoryTest, GoesAlongWhenTheRigChanges) {
  SessionRooms rooms;
  const auto binding = rooms.bindings().Use("t", rooms.binding_id, "x").value();
  pose_ = RestPose(binding.binding->rig());
  Edit(1, Put(0, 5));
  Edit(2, Put(1, 6));
  std::vector<int32_t> previous = {-1, 0, 2, 3, 4, 5, 6, 7};
  const PoseTransfer transfer =
      PoseTransfer::Create(*binding.binding, *binding.binding, previous, pose_)
          .value();
  history_.Transfer(transfer);
  pose_ = transfer.Transfer(pose_);
  const Pose before = pose_;
  // The second edit was of a handle that is gone.
  EXPECT_EQ(Do(Direction::kUndo).edit, 1u);
  EXPECT_FALSE(CanDo(Direction::kUndo));
  EXPECT_NE(pose_.vertices.row(1), before.vertices.row(1));
  Do(Direction::kRedo);
  EXPECT_EQ(pose_.vertices, before.vertices);
}

}  // namespace
}  // namespace deform::server
