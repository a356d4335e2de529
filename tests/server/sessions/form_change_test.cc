// Sessions whose weights are compressed while they go on.
#include <gtest/gtest.h>

#include "core/weights/handle_edit.h"
#include "server/sessions/session_manager.h"
#include "tests/server/sessions/support.h"
#include "tests/server/stores/memory_store.h"

namespace deform::server {
namespace {

constexpr double kTolerance = 1e-3;
// Float weights and frames; D of the cube is 3.5.
constexpr double kFrameTolerance = 2e-6 * 3.5;

class FormChangeTest : public testing::Test {
 protected:
  FormChangeTest() {
    record_ = BindTo(BallCage(), "green");
    session_ = sessions_.Create("t", record_->id, "s").value();
  }

  // What is left to run holds sessions, or refers to the registry.
  void TearDown() override {
    background_.RunAll();
    compute_.RunAll();
  }

  std::shared_ptr<const BindingRecord> BindTo(Rig rig,
                                              const std::string& scheme) {
    const auto waiter = bindings_.Create({.tenant = "t",
                                          .model_id = model_id_,
                                          .rig = std::move(rig),
                                          .scheme = scheme,
                                          .weight_tolerance = kTolerance});
    return (*waiter)->Wait(std::chrono::minutes(1)).value().value().record;
  }

  FakeStream Join(const std::shared_ptr<Session>& session) {
    FakeStream stream;
    auto joined =
        session->Join(Delivery::kEvery, FrameWishes{}, stream.receiver);
    stream.participant = std::move(joined->participant);
    compute_.RunAll();
    stream.TakeFrame();
    return stream;
  }
  // Takes frames of the basis.
  FakeStream JoinForBasis() {
    FakeStream stream;
    const FrameWishes wishes{.encodings = {FindEncoding("basis")},
                             .tolerance = 1e-3};
    auto joined = session_->Join(Delivery::kEvery, wishes, stream.receiver);
    stream.participant = std::move(joined->participant);
    compute_.RunAll();
    return stream;
  }
  FrameToSend Posed(FakeStream& stream, uint64_t sequence,
                    const PoseUpdate& update) {
    stream.participant->Submit(sequence, update);
    compute_.RunAll();
    return stream.TakeFrame();
  }
  // What dense weights show of that vertex moved there, and how far compressed
  // ones may be from it.
  Positions Dense(int32_t vertex, const Vec3& to) {
    const auto dense = Bind(record_->facts.request(), {}).value();
    Deformer deformer(dense, nullptr);
    Pose pose = RestPose(dense->rig());
    pose.vertices.row(vertex) = to.transpose();
    deformer.MoveTo(pose);
    return deformer.positions();
  }
  // The largest displacement is below 1, that of scaled normals below 2.
  double Allowed() const {
    return kTolerance * DiagonalOf(record_->facts.rig()) + kFrameTolerance;
  }

  ManualExecutor background_;
  ManualExecutor compute_;
  ThreadPool pool_{{.threads = 1}};
  const std::unique_ptr<Store> store_ = MemoryStore();
  ModelRegistry models_{
      {.model_bytes = 1 << 20, .memory = 1 << 20, .count = 10}, *store_};
  BindingRegistry bindings_{
      models_,
      pool_,
      {.memory = 1 << 24, .count = 30, .concurrent = 1, .waiting_calls = 1},
      &Bind,
      {.executor = background_.executor(),
       // However small, and if it does not save anything.
       .compress =
           [](const Binding& dense, double tolerance, const BindControl&) {
             return CompressBinding(dense, &dense.weights(), tolerance, {},
                                    dense.solutions());
           },
       .is_worth = [](int64_t) { return true; }}};
  const std::string model_id_ =
      models_.Register("t", "", MeshOf(Icosphere(0.5, 1))).value().record->id;
  BatchScheduler scheduler_{
      {.executor = compute_.executor(), .max_sessions = 3}};
  SessionManager sessions_{bindings_,
                           {.memory = 1 << 24, .count = 10},
                           {.scheduler = &scheduler_, .clock = [] {
                              return std::chrono::steady_clock::time_point();
                            }}};
  std::shared_ptr<const BindingRecord> record_;
  std::shared_ptr<Session> session_;
};

TEST_F(FormChangeTest, GoesOnBetweenTwoPosesWithoutARevision) {
  FakeStream stream = Join(session_);
  const FrameToSend before = Posed(stream, 1, MoveVertex(7, {1.5, 1, 1}));
  EXPECT_EQ(before.frame->info.revision, 1u);
  EXPECT_LT(
      (Decoded(*before.frame) - Dense(7, {1.5, 1, 1})).cwiseAbs().maxCoeff(),
      kFrameTolerance);
  background_.RunAll();
  ASSERT_TRUE(record_->weights->state().compressed);
  compute_.RunAll();
  EXPECT_FALSE(stream.participant->Take().has_value());
  EXPECT_EQ(session_->state().revision, 1u);

  const FrameToSend after = Posed(stream, 2, MoveVertex(7, {1.4, 1.2, 1}));
  EXPECT_EQ(after.frame->info.revision, 2u);
  EXPECT_EQ(after.skipped_revisions, 0u);
  EXPECT_LT((Decoded(*after.frame) - Dense(7, {1.4, 1.2, 1}))
                .rowwise()
                .norm()
                .maxCoeff(),
            Allowed());
}

TEST_F(FormChangeTest, AppliesMovedColumnsAloneInBothForms) {
  FakeStream stream = Join(session_);
  Posed(stream, 1, MoveVertex(7, {1.5, 1, 1}));
  const auto dense = Posed(stream, 2, MoveVertex(7, {1.5, 1.1, 1}));
  background_.RunAll();
  const auto compressed = Posed(stream, 3, MoveVertex(7, {1.5, 1.2, 1}));
  // The vertex, and the faces around it, of 8 and 12.
  EXPECT_LE(dense.frame->info.columns_applied, 7);
  EXPECT_EQ(compressed.frame->info.columns_applied,
            dense.frame->info.columns_applied);
}

TEST_F(FormChangeTest, TellsWhoTakesItOfTheBasis) {
  FakeStream plain = Join(session_);
  Posed(plain, 1, MoveVertex(7, {1.5, 1, 1}));
  background_.RunAll();
  EXPECT_EQ(Posed(plain, 2, MoveVertex(7, {1.5, 1.1, 1})).frame->info.basis_id,
            "")
      << "nobody wants it";

  FakeStream taker = JoinForBasis();
  EXPECT_EQ(taker.TakeFrame().frame->encoding->id(), "float32");
  const FrameToSend told = Posed(plain, 3, MoveVertex(7, {1.5, 1.2, 1}));
  const std::string id = told.frame->info.basis_id;
  EXPECT_EQ(id, sessions_.frame_tables().BasisOf(record_->weights->Get())->id);
  EXPECT_TRUE(told.tells_basis);
  EXPECT_EQ(taker.TakeFrame().frame->encoding->id(), "float32");
  taker.participant->Hold({.basis = id});
  Posed(plain, 4, MoveVertex(7, {1.5, 1.3, 1}));
  EXPECT_EQ(taker.TakeFrame().frame->encoding->id(), "basis");
}

TEST_F(FormChangeTest, FramesOfTheBasisBeginAfterTheFormHasChanged) {
  FakeStream taker = JoinForBasis();
  EXPECT_EQ(taker.TakeFrame().frame->info.basis_id, "");
  background_.RunAll();
  compute_.RunAll();
  // Known from the binding already, before the session tells.
  taker.participant->Hold(
      {.basis = sessions_.frame_tables().BasisOf(record_->weights->Get())->id});
  Posed(taker, 1, MoveVertex(7, {1.5, 1, 1}));
  const FrameToSend frame = Posed(taker, 2, MoveVertex(7, {1.5, 1.1, 1}));
  EXPECT_EQ(frame.frame->encoding->id(), "basis");
  EXPECT_NE(frame.frame->info.basis_id, "");
}

TEST_F(FormChangeTest, LetsTheDenseWeightsGo) {
  FakeStream stream = Join(session_);
  const int64_t dense = record_->weights->state().bytes;
  const int64_t facts = bindings_.budget().used() - dense;
  background_.RunAll();
  EXPECT_GE(bindings_.budget().used(), dense) << "the session has them";
  compute_.RunAll();
  EXPECT_EQ(bindings_.budget().used(), facts + record_->weights->state().bytes);
  EXPECT_EQ(record_->weights->state().users, 1);
}

TEST_F(FormChangeTest, ChangesOverThoughPosesWait) {
  FakeStream stream = Join(session_);
  stream.participant->Submit(1, MoveVertex(7, {1.5, 1, 1}));
  background_.RunAll();
  stream.participant->Submit(2, MoveVertex(7, {1.4, 1.2, 1}));
  compute_.RunAll();
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 1u);
  const FrameToSend second = stream.TakeFrame();
  EXPECT_EQ(second.frame->info.revision, 2u);
  EXPECT_LT((Decoded(*second.frame) - Dense(7, {1.4, 1.2, 1}))
                .rowwise()
                .norm()
                .maxCoeff(),
            Allowed());
}

TEST_F(FormChangeTest, ASessionThatEndsMeanwhileIsLeftAlone) {
  {
    FakeStream stream = Join(session_);
    ASSERT_TRUE(sessions_.Delete("t", "s").ok());
  }
  background_.RunAll();
  compute_.RunAll();
  session_ = nullptr;
  EXPECT_TRUE(bindings_.Remove("t", record_->id).ok());
  record_ = nullptr;
  EXPECT_EQ(bindings_.budget().used(), 0);
}

// Nine handles: the corners of a cube, and one within.
Handles FirstHandles() {
  Positions handles(9, 3);
  handles << BallCage().vertices(), 0.1, 0, 0;
  return Handles::Create(3, handles).value();
}

TEST_F(FormChangeTest, HandlesOfACompressedBindingAreEditedFromItsSolutions) {
  const auto first = BindTo(FirstHandles(), "s_cc");
  background_.RunAll();
  const auto compressed = first->weights->Get();
  ASSERT_NE(compressed->compressed(), nullptr);
  EXPECT_NE(compressed->solutions(), nullptr);
}

TEST_F(FormChangeTest, TheFormOfABindingThatTheSessionLeavesIsNotTaken) {
  const auto first = BindTo(FirstHandles(), "s_cc");
  const std::vector<HandleEdit> edits = {
      {.kind = HandleEdit::Kind::kAdd, .position = {0, 0.2, 0.3}}};
  const EditedHandles edited = EditHandles(FirstHandles(), {}, edits).value();
  const auto second = BindTo(edited.handles, "s_cc");
  const auto session = sessions_.Create("t", first->id, "h").value();
  FakeStream stream = Join(session);
  RigMoves moves;
  sessions_.Move(*first, *second, edited.previous, {}, moves);
  // Both are compressed while the move waits for its turn.
  background_.RunAll();
  compute_.RunAll();
  EXPECT_EQ(session->state().binding_id, second->id);
  EXPECT_TRUE(
      std::holds_alternative<RigChanged>(stream.participant->Take().value()));
  EXPECT_EQ(stream.TakeFrame().frame->info.revision, 1u);
  EXPECT_EQ(first->weights->state().users, 0);
  EXPECT_NE(second->weights->Get()->compressed(), nullptr);
  EXPECT_EQ(second->weights->state().users, 1);
}

}  // namespace
}  // namespace deform::server
