// Sessions whose handles are edited while they go on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "core/base/error.h"
#include "core/weights/handle_edit.h"
#include "server/sessions/session_manager.h"
#include "tests/server/sessions/support.h"
#include "tests/server/stores/memory_store.h"

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Kind = HandleEdit::Kind;

// Float weights and frames; D of the cube is 3.5.
constexpr double kFrameTolerance = 2e-6 * 3.5;

// Nine handles: the corners of a cube, and one within.
Handles FirstHandles() {
  Positions handles(9, 3);
  handles << BallCage().vertices(), 0.1, 0, 0;
  return Handles::Create(3, handles).value();
}

class RigChangeTest : public testing::Test {
 protected:
  RigChangeTest() {
    first_ = BindTo(FirstHandles());
    session_ = sessions_.Create("t", first_->id, "s").value();
  }

  // What is left to run holds sessions.
  void TearDown() override { executor_.RunAll(); }

  std::shared_ptr<const BindingRecord> BindTo(const Handles& handles) {
    const auto waiter = bindings_.Create({.tenant = "t",
                                          .model_id = model_id_,
                                          .rig = handles,
                                          .scheme = "s_cc"});
    return (*waiter)->Wait(std::chrono::minutes(1)).value().value().record;
  }

  // The binding of `from` edited.
  struct Edited {
    std::shared_ptr<const BindingRecord> record;
    std::vector<int32_t> previous;
  };
  Edited Edit(const BindingRecord& from, std::vector<HandleEdit> edits) {
    const EditedHandles edited =
        EditHandles(std::get<Handles>(from.facts.rig()), {}, edits).value();
    return {BindTo(edited.handles), edited.previous};
  }
  void Move(const Edited& edited) {
    sessions_.Move(*first_, *edited.record, edited.previous, {}, moves_);
  }
  absl::StatusOr<RigMoved> Outcome() {
    EXPECT_TRUE(moves_.Wait(std::chrono::milliseconds(0)));
    return moves_.outcomes().back().moved;
  }

  FakeStream Join(Delivery delivery = Delivery::kLatest,
                  const FrameWishes& wishes = {}) {
    FakeStream stream;
    auto joined = session_->Join(delivery, wishes, stream.receiver);
    stream.participant = std::move(joined->participant);
    stream.joined = joined->state;
    stream.pose = joined->pose;
    return stream;
  }
  FakeStream JoinAndSee(Delivery delivery = Delivery::kLatest) {
    FakeStream stream = Join(delivery);
    executor_.RunAll();
    stream.TakeFrame();
    return stream;
  }
  std::shared_ptr<const RigChange> TakeChange(FakeStream& stream) {
    return std::get<RigChanged>(stream.participant->Take().value()).change;
  }
  // What a binding shows of a pose.
  static Positions Shown(const BindingRecord& record, const Pose& pose) {
    Deformer deformer(record.weights->Get(), nullptr);
    deformer.MoveTo(pose);
    return deformer.positions();
  }
  Pose PoseOfSession() { return Join().pose; }

  const HandleEdit add_ = {.kind = Kind::kAdd, .position = {0, 0.2, 0.3}};

  ThreadPool pool_{{.threads = 1}};
  const std::unique_ptr<Store> store_ = MemoryStore();
  ModelRegistry models_{
      {.model_bytes = 1 << 20, .memory = 1 << 20, .count = 10}, *store_};
  BindingRegistry bindings_{
      models_,
      pool_,
      {.memory = 1 << 24, .count = 30, .concurrent = 1, .waiting_calls = 1}};
  const std::string model_id_ =
      models_.Register("t", "", MeshOf(Icosphere(0.5, 1))).value().record->id;
  ManualClock clock_;
  ManualExecutor executor_;
  BatchScheduler scheduler_{
      {.executor = executor_.executor(), .max_sessions = 3}};
  SessionManager sessions_{bindings_,
                           {.memory = 1 << 24, .count = 10},
                           {.scheduler = &scheduler_,
                            .clock = clock_.clock(),
                            .max_participants = 5,
                            .stall_timeout = std::chrono::seconds(10)}};
  RigMoves moves_;
  std::shared_ptr<const BindingRecord> first_;
  std::shared_ptr<Session> session_;
};

TEST_F(RigChangeTest, TellsParticipantsBeforeTheFirstFrameOfTheNewRig) {
  FakeStream stream = JoinAndSee();
  const Edited edited = Edit(*first_, {add_});
  Move(edited);
  executor_.RunAll();
  const auto change = TakeChange(stream);
  EXPECT_EQ(change->binding_id, edited.record->id);
  EXPECT_EQ(change->revision, 1u);
  EXPECT_EQ(change->transfer.previous().back(), -1);
  const FrameToSend sent = stream.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 1u);
  EXPECT_EQ(sent.skipped_revisions, 0u);
  EXPECT_EQ(session_->state().binding_id, edited.record->id);
  EXPECT_EQ(Outcome()->revision, 1u);
}

TEST_F(RigChangeTest, KeepsThePoseAndTellsTheTrueJump) {
  FakeStream stream = JoinAndSee();
  stream.participant->Submit(1, MoveVertex(8, {0.3, 0.1, 0.2}));
  executor_.RunAll();
  const Pose before = PoseOfSession();
  const Positions seen = Shown(*first_, before);
  stream.TakeFrame();
  const Edited edited = Edit(*first_, {add_});
  Move(edited);
  executor_.RunAll();
  const auto change = TakeChange(stream);
  const Pose& after = change->transfer.pose();
  EXPECT_EQ(after.vertices.topRows(9), before.vertices);
  const Positions now = Decoded(*stream.TakeFrame().frame);
  EXPECT_LT((now - Shown(*edited.record, after)).cwiseAbs().maxCoeff(),
            kFrameTolerance);
  const double jump = (now - seen).rowwise().norm().maxCoeff() /
                      DiagonalOf(edited.record->facts.rig());
  EXPECT_NEAR(change->largest_jump, jump, 4e-6);
  EXPECT_GT(change->largest_jump, 0);
  EXPECT_EQ(Outcome()->largest_jump, change->largest_jump);
}

TEST_F(RigChangeTest, PosesComeAgainOnceTheNewWeightsAreHeld) {
  for (const Delivery delivery : {Delivery::kLatest, Delivery::kEvery}) {
    session_ = sessions_.Create("t", first_->id, "").value();
    FakeStream stream = Join(delivery, {.encodings = {FindEncoding("pose")},
                                        .weights = {.binding = first_->id}});
    executor_.RunAll();
    EXPECT_EQ(stream.TakeFrame().frame->encoding->id(), "pose");
    EXPECT_FALSE(stream.participant->Take().has_value());
    const Edited edited = Edit(*first_, {add_});
    Move(edited);
    executor_.RunAll();
    TakeChange(stream);
    const FrameToSend other = stream.TakeFrame();
    EXPECT_EQ(other.frame->encoding->id(), "float32");
    EXPECT_EQ(other.skipped_revisions, 0u);
    EXPECT_FALSE(stream.participant->Take().has_value());
    stream.participant->Hold({.binding = edited.record->id});
    stream.participant->Submit(1, MoveVertex(0, {-1, -1, -1.5}));
    executor_.RunAll();
    const FrameToSend again = stream.TakeFrame();
    EXPECT_EQ(again.frame->encoding->id(), "pose");
    EXPECT_FALSE(again.frame->reference_revision.has_value());
  }
}

TEST_F(RigChangeTest, DoesNotJumpAtRest) {
  FakeStream stream = JoinAndSee();
  Move(Edit(*first_, {add_, {.kind = Kind::kRemove, .handle = 8}}));
  executor_.RunAll();
  EXPECT_LT(TakeChange(stream)->largest_jump, 1e-15);
}

TEST_F(RigChangeTest, TakesWaitingPosesOverToTheNewRig) {
  FakeStream stream = JoinAndSee();
  const Edited edited =
      Edit(*first_, {{.kind = Kind::kRemove, .handle = 0}, add_});
  // In the queue when the session moves: handle 8, which will be row 7.
  stream.participant->Submit(1, MoveVertex(8, {0.3, 0.1, 0.2}));
  Move(edited);
  executor_.RunAll();
  const auto change = TakeChange(stream);
  EXPECT_EQ(change->revision, 1u);
  const FrameToSend sent = stream.TakeFrame();
  EXPECT_EQ(sent.frame->info.revision, 2u);
  EXPECT_EQ(sent.answers_sequence, 1u);
  const Pose pose = PoseOfSession();
  EXPECT_EQ(pose.vertices.row(7), Eigen::RowVector3d(0.3, 0.1, 0.2));
  EXPECT_EQ(pose.vertices.row(8), Eigen::RowVector3d(0, 0.2, 0.3));
}

TEST_F(RigChangeTest, TakesPosesInFlightOverToTheNewRig) {
  FakeStream stream = JoinAndSee();
  Move(Edit(*first_, {{.kind = Kind::kRemove, .handle = 0}, add_}));
  executor_.RunAll();
  // Sent before the change was read: all nine handles as they were.
  Positions whole = FirstHandles().positions();
  whole.rowwise() += Eigen::RowVector3d(0.5, 0, 0);
  stream.participant->Submit(1, PoseUpdate{.positions = whole}, {0});
  executor_.RunAll();
  const Pose pose = PoseOfSession();
  EXPECT_EQ(pose.vertices.topRows(8), whole.bottomRows(8));
  EXPECT_EQ(pose.vertices.row(8), Eigen::RowVector3d(0, 0.2, 0.3));
  // And after it was read: the new row.
  stream.participant->Submit(2, MoveVertex(8, {0, 0, 0.4}), {1});
  executor_.RunAll();
  EXPECT_EQ(PoseOfSession().vertices.row(8), Eigen::RowVector3d(0, 0, 0.4));
}

TEST_F(RigChangeTest, NeverAppliesAPoseToAnotherHandle) {
  FakeStream stream = JoinAndSee();
  Move(Edit(*first_, {{.kind = Kind::kRemove, .handle = 8}, add_}));
  executor_.RunAll();
  TakeChange(stream);
  stream.TakeFrame();
  // Row 8 is the new handle now.
  stream.participant->Submit(1, MoveVertex(8, {0.3, 0.1, 0.2}), {0});
  const auto rejection =
      std::get<Rejection>(stream.participant->Take().value());
  EXPECT_EQ(DetailOf(rejection.status).reason, "RIG_CHANGED");
  EXPECT_EQ(rejection.status.message(),
            "the rig has changed: all handles that this pose moves were "
            "removed");
}

TEST_F(RigChangeTest, RefusesPosesThatFitNoRigClearly) {
  FakeStream stream = JoinAndSee();
  Move(Edit(*first_, {add_}));
  executor_.RunAll();
  TakeChange(stream);
  stream.TakeFrame();
  const PoseUpdate ten{.positions = Positions::Ones(10, 3)};
  stream.participant->Submit(1, ten, {0});
  absl::Status status =
      std::get<Rejection>(stream.participant->Take().value()).status;
  EXPECT_EQ(DetailOf(status).reason, "WRONG_LENGTH");
  EXPECT_EQ(status.message(),
            "the rig has changed, and this pose is not for the new one "
            "(rig_changes): pose has 10 positions, but the rig has 9 "
            "vertices");
  stream.participant->Submit(2, ten, {2});
  status = std::get<Rejection>(stream.participant->Take().value()).status;
  EXPECT_EQ(DetailOf(status).reason, "RIG_UNKNOWN");
  EXPECT_EQ(status.message(),
            "pose.rig_changes is 2, but this stream was told of 1");
  stream.participant->Submit(3, ten, {1});
  executor_.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 3u);
}

TEST_F(RigChangeTest, CountsChangesFromJoiningOn) {
  Move(Edit(*first_, {add_}));
  executor_.RunAll();
  FakeStream late = JoinAndSee();
  EXPECT_EQ(late.pose.vertices.rows(), 10);
  late.participant->Submit(1, PoseUpdate{.positions = Positions::Ones(10, 3)});
  executor_.RunAll();
  EXPECT_EQ(late.TakeFrame().answers_sequence, 1u);
}

TEST_F(RigChangeTest, TellsThoseWhoJoinBeforeItIsDone) {
  JoinAndSee();
  Move(Edit(*first_, {add_}));
  FakeStream early = Join();
  EXPECT_EQ(early.pose.vertices.rows(), 9);
  executor_.RunAll();
  EXPECT_EQ(TakeChange(early)->transfer.previous().size(), 10u);
  EXPECT_EQ(early.TakeFrame().frame->info.revision, 1u);
}

TEST_F(RigChangeTest, KeepsTheOrderOfFramesAndChangesWithEveryDelivery) {
  FakeStream stream = JoinAndSee(Delivery::kEvery);
  stream.participant->Submit(1, MoveVertex(8, {0.3, 0.1, 0.2}));
  executor_.RunAll();
  Move(Edit(*first_, {add_}));
  executor_.RunAll();
  stream.participant->Submit(2, MoveVertex(8, {0.2, 0.1, 0.2}));
  executor_.RunAll();
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 1u);
  EXPECT_EQ(TakeChange(stream)->revision, 2u);
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 2u);
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 3u);
}

TEST_F(RigChangeTest, WaitsForWhoTakesEveryFrame) {
  FakeStream stream = JoinAndSee(Delivery::kEvery);
  for (uint64_t i = 1; i <= Outbox::kMaxFrames; ++i) {
    stream.participant->Submit(i, MoveVertex(8, {0.3, 0.1, 0.2}));
    executor_.RunAll();
  }
  Move(Edit(*first_, {add_}));
  executor_.RunAll();
  EXPECT_EQ(session_->state().binding_id, first_->id);
  stream.TakeFrame();
  executor_.RunAll();
  EXPECT_NE(session_->state().binding_id, first_->id);
}

TEST_F(RigChangeTest, LetsTheOldBindingGo) {
  const Edited edited = Edit(*first_, {add_});
  EXPECT_EQ(DetailOf(bindings_.Remove("t", first_->id)).reason,
            "BINDING_IN_USE");
  Move(edited);
  executor_.RunAll();
  EXPECT_TRUE(bindings_.Remove("t", first_->id).ok());
  EXPECT_EQ(DetailOf(bindings_.Remove("t", edited.record->id)).reason,
            "BINDING_IN_USE");
}

TEST_F(RigChangeTest, OfTwoAtOnceTheSecondFindsAnotherBinding) {
  const Edited one = Edit(*first_, {add_});
  const Edited other = Edit(*first_, {{.kind = Kind::kRemove, .handle = 8}});
  Move(one);
  Move(other);
  executor_.RunAll();
  EXPECT_EQ(session_->state().binding_id, one.record->id);
  const auto outcomes = moves_.outcomes();
  EXPECT_TRUE(outcomes[0].moved.ok());
  EXPECT_EQ(DetailOf(outcomes[1].moved.status()).reason, "OTHER_BINDING");
  EXPECT_THAT(std::string(outcomes[1].moved.status().message()),
              HasSubstr("session \"s\" has binding \"" + one.record->id +
                        "\" by now, not \"" + first_->id + "\""));
}

TEST_F(RigChangeTest, IsToldWhenTheSessionEndsFirst) {
  Move(Edit(*first_, {add_}));
  ASSERT_TRUE(sessions_.Delete("t", "s").ok());
  EXPECT_EQ(DetailOf(Outcome().status()).reason, "SESSION_DELETED");
  executor_.RunAll();
}

TEST_F(RigChangeTest, IsRefusedBySessionsThatAreNotThere) {
  const Edited edited = Edit(*first_, {add_});
  sessions_.Move(*first_, *edited.record, edited.previous, {"nobody"}, moves_);
  EXPECT_EQ(DetailOf(Outcome().status()).reason, "SESSION_NOT_FOUND");
  EXPECT_EQ(DetailOf(sessions_.CheckHave("t", {"s"}, edited.record->id)).reason,
            "OTHER_BINDING");
  EXPECT_TRUE(sessions_.CheckHave("t", {"s"}, first_->id).ok());
}

TEST_F(RigChangeTest, TakesPosesOverManyChangesButNotAnyNumber) {
  FakeStream stream = JoinAndSee();
  std::shared_ptr<const BindingRecord> now = first_;
  const auto change_once = [&](uint64_t i) {
    const double x = 0.01 * static_cast<double>(i + 1);
    const Edited edited = Edit(
        *now,
        {{.kind = Kind::kMove, .handle = 0, .position = {-1 - x, -1, -1}}});
    sessions_.Move(*now, *edited.record, edited.previous, {}, moves_);
    executor_.RunAll();
    now = edited.record;
    TakeChange(stream);
    stream.TakeFrame();
  };
  for (uint64_t i = 0; i < RigHistory::kMaxChanges; ++i) change_once(i);
  stream.participant->Submit(1, MoveVertex(8, {0.3, 0.1, 0.2}), {0});
  executor_.RunAll();
  EXPECT_EQ(stream.TakeFrame().answers_sequence, 1u);
  EXPECT_EQ(PoseOfSession().vertices.row(8), Eigen::RowVector3d(0.3, 0.1, 0.2));
  change_once(RigHistory::kMaxChanges);
  stream.participant->Submit(2, MoveVertex(8, {0.3, 0.1, 0.2}), {0});
  const absl::Status status =
      std::get<Rejection>(stream.participant->Take().value()).status;
  EXPECT_EQ(DetailOf(status).reason, "RIG_CHANGED");
  EXPECT_EQ(status.message(),
            "the rig has changed 17 times since the one that this pose is for: "
            "read rig_changed");
}

}  // namespace
}  // namespace deform::server
