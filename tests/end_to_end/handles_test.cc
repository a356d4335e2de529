// Handles edited over a real connection, while sessions go on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>

#include "core/base/error.h"
#include "core/deform/deformer.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Kind = HandleEdit::Kind;

// Float weights and float frames, in units of D of the cube.
constexpr double kFrameTolerance = 2e-6 * 3.5;

RigArrays CubeHandles() {
  return RigArrays(RigKind::kHandles, 3, Cube().vertices(), Faces());
}
HandleEdit Add(const Vec3& at, double weight = 0) {
  return {.kind = Kind::kAdd, .position = at, .weight = weight};
}
HandleEdit Remove(int64_t handle) {
  return {.kind = Kind::kRemove, .handle = handle};
}
HandleEdit Move(int64_t handle, const Vec3& to) {
  return {.kind = Kind::kMove, .handle = handle, .position = to};
}

class EditedHandlesTest : public testing::Test {
 protected:
  EditedHandlesTest()
      : model_id_(client().RegisterModel(Ball(), "ball").value().model_id),
        first_(Bind(CubeHandles())) {}

  Client& client() { return server_.client(); }
  BindingInfo Bind(const RigArrays& rig, const std::string& scheme = "s_cc",
                   const std::vector<double>& weights = {}) {
    BindingSpec spec{.model_id = model_id_, .rig = rig, .scheme = scheme};
    spec.options.handle_weights = weights;
    return client().CreateBinding(spec).value();
  }
  EditedBinding Edit(const std::string& binding, std::vector<HandleEdit> edits,
                     const EditOptions& options = {}) {
    return client().EditHandles(binding, edits, options).value();
  }
  absl::Status Refusal(std::vector<HandleEdit> edits,
                       const EditOptions& options = {}) {
    return client().EditHandles(first_.binding_id, edits, options).status();
  }
  std::string Session(const std::string& binding) {
    return client().CreateSession(binding).value().session_id;
  }
  // The next frame that shows `revision` or a later one.
  static Frame Await(DeformStream& stream, uint64_t revision) {
    Frame frame;
    do {
      EXPECT_TRUE(stream.NextFrame(frame).ok());
    } while (frame.revision < revision && !stream.ended());
    return frame;
  }

  RunningServer server_;
  const std::string model_id_;
  const BindingInfo first_;
};

TEST_F(EditedHandlesTest, MakeTheBindingThatBindingThemAfreshMakes) {
  const EditedBinding edited = Edit(
      first_.binding_id, {Remove(2), Add({0, 0, 1.5}), Move(0, {-2, -2, -2})});
  EXPECT_THAT(edited.previous, ElementsAre(0, 1, 3, 4, 5, 6, 7, -1));
  RigArrays rig = client().GetRig(edited.binding.binding_id).value();
  EXPECT_EQ(rig.vertices.row(0), Eigen::RowVector3d(-2, -2, -2));
  EXPECT_EQ(rig.vertices.row(7), Eigen::RowVector3d(0, 0, 1.5));
  EXPECT_FALSE(edited.binding.existed);
  const BindingInfo afresh = Bind(rig);
  EXPECT_EQ(afresh.binding_id, edited.binding.binding_id);
  EXPECT_TRUE(afresh.existed);
}

TEST_F(EditedHandlesTest, KeepTheirUserWeights) {
  const BindingInfo weighted =
      Bind(CubeHandles(), "t_cc", {1, 2, 3, 4, 5, 6, 7, 8});
  const EditedBinding edited =
      Edit(weighted.binding_id, {Remove(0), Add({0, 0, 0.1}, 0.5)});
  RigArrays rig = client().GetRig(edited.binding.binding_id).value();
  EXPECT_EQ(Bind(rig, "t_cc", {2, 3, 4, 5, 6, 7, 8, 0.5}).binding_id,
            edited.binding.binding_id);
}

TEST_F(EditedHandlesTest, TakeSessionsAlong) {
  const std::string session = Session(first_.binding_id);
  auto stream = client().Deform(session).value();
  const uint64_t sequence =
      stream
          .Send({.vertices = {7}, .positions = Positions::Constant(1, 3, 1.3)})
          .value();
  Frame before;
  do {
    ASSERT_TRUE(stream.NextFrame(before).ok());
  } while (before.answers_sequence < sequence);
  const EditedBinding edited = Edit(first_.binding_id, {Add({0.2, 0.1, 0})});
  ASSERT_THAT(edited.moved, SizeIs(1));
  EXPECT_EQ(edited.moved[0].session_id, session);
  EXPECT_EQ(edited.moved[0].revision, 2u);
  EXPECT_THAT(edited.not_moved, IsEmpty());
  EXPECT_EQ(client().GetSession(session)->binding_id,
            edited.binding.binding_id);
  const Frame after = Await(stream, 2);
  ASSERT_THAT(stream.rig_changes(), SizeIs(1));
  const RigChange& change = stream.rig_changes()[0];
  EXPECT_EQ(change.binding_id, edited.binding.binding_id);
  EXPECT_EQ(change.vertex_count, 9);
  EXPECT_EQ(change.largest_jump, edited.moved[0].largest_jump);
  const double jump = (after.DoublePositions() - before.DoublePositions())
                          .rowwise()
                          .norm()
                          .maxCoeff() /
                      edited.binding.rig_diagonal;
  EXPECT_NEAR(change.largest_jump, jump, 4e-6);
  EXPECT_LT(change.largest_jump, 0.05);
  // The new handle can be posed.
  stream.Send({.vertices = {8}, .positions = Positions::Constant(1, 3, 0.4)})
      .value();
  EXPECT_EQ(Await(stream, 3).answers_sequence, 2u);
  // The old binding is free to go.
  EXPECT_TRUE(client().DeleteBinding(first_.binding_id).ok());
}

TEST_F(EditedHandlesTest, TakeOnlyTheSessionsThatAreNamed) {
  const std::string one = Session(first_.binding_id);
  const std::string two = Session(first_.binding_id);
  const EditedBinding edited =
      Edit(first_.binding_id, {Add({0.2, 0.1, 0})}, {.sessions = {two}});
  EXPECT_THAT(edited.moved, SizeIs(1));
  EXPECT_EQ(client().GetSession(one)->binding_id, first_.binding_id);
  EXPECT_EQ(client().GetSession(two)->binding_id, edited.binding.binding_id);
  EXPECT_THAT(
      Edit(first_.binding_id, {Add({0.3, 0.1, 0})}, {.keep_sessions = true})
          .moved,
      IsEmpty());
  const absl::Status other = Refusal({Add({0.2, 0.2, 0})}, {.sessions = {two}});
  EXPECT_EQ(other.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(other).reason, "OTHER_BINDING");
  EXPECT_EQ(DetailOf(Refusal({Add({0, 0, 0})}, {.sessions = {"none"}})).reason,
            "SESSION_NOT_FOUND");
  EXPECT_EQ(
      Refusal({Add({0, 0, 0})}, {.sessions = {one}, .keep_sessions = true})
          .message(),
      "sessions are named to move, and none is to move");
}

TEST_F(EditedHandlesTest, ThatAreRefusedChangeNothing) {
  const std::string session = Session(first_.binding_id);
  std::vector<HandleEdit> inwards;
  for (int64_t k = 0; k < 5; ++k) {
    inwards.push_back(Move(k, {0.01 * static_cast<double>(k), 0, 0}));
  }
  const absl::Status outside = Refusal(inwards);
  EXPECT_EQ(outside.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(outside).reason, "OUTSIDE_HULL");
  EXPECT_THAT(std::string(outside.message()),
              HasSubstr("outside the convex hull of the handles: "));
  EXPECT_EQ(Refusal({}).message(),
            "there are no edits: add, move or remove a handle");
  EXPECT_EQ(Refusal({Remove(8)}).message(), "edit 0 names handle 8 of 8");
  EXPECT_EQ(Refusal({Remove(0), Remove(1), Remove(2), Remove(3), Remove(4)})
                .message(),
            "a 3D rig needs at least 4 handles, not 3");
  EXPECT_THAT(std::string(Refusal({Add({0, 0, 0.1}, 1)}).message()),
              HasSubstr("scheme s_cc has no handle weights"));
  EXPECT_THAT(client().ListBindings().value(), SizeIs(1));
  EXPECT_EQ(client().GetSession(session)->revision, 0u);
  EXPECT_EQ(client().GetSession(session)->binding_id, first_.binding_id);
}

TEST_F(EditedHandlesTest, AreNotThoseOfACage) {
  const BindingInfo cage = server_.BindBall();
  const HandleEdit edits[] = {Add({0, 0, 0})};
  const absl::Status status =
      client().EditHandles(cage.binding_id, edits).status();
  EXPECT_EQ(DetailOf(status).reason, "WRONG_RIG");
  EXPECT_EQ(status.message(), "binding \"" + cage.binding_id +
                                  "\" has a cage; only handles can be edited");
  EXPECT_EQ(DetailOf(client().EditHandles("b-none", edits).status()).reason,
            "BINDING_NOT_FOUND");
}

TEST_F(EditedHandlesTest, KeepTheBoxAndTheClampedPoints) {
  BindingSpec spec{.model_id = model_id_, .scheme = "s_cc"};
  spec.rig = RigArrays(RigKind::kHandles, 3, Positions::Zero(1, 3), Faces());
  spec.add_box_handles = true;
  spec.clamped = {3};
  const BindingInfo boxed = client().CreateBinding(spec).value();
  const EditedBinding edited = Edit(boxed.binding_id, {Add({0.1, 0, 0})});
  EXPECT_EQ(edited.binding.vertex_count, 2);
  EXPECT_EQ(edited.binding.fixed_handle_count, 8);
  EXPECT_THAT(edited.binding.clamped, ElementsAre(3));
  Positions handles = Positions::Zero(2, 3);
  handles(1, 0) = 0.1;
  spec.rig.vertices = handles;
  EXPECT_EQ(client().CreateBinding(spec)->binding_id,
            edited.binding.binding_id);
}

TEST_F(EditedHandlesTest, MayBeEditedByTwoAtOnce) {
  const std::string session = Session(first_.binding_id);
  std::vector<absl::StatusOr<EditedBinding>> edited(
      2, absl::UnknownError("not yet"));
  std::vector<std::thread> editors;
  for (int k = 0; k < 2; ++k) {
    editors.emplace_back([&, k] {
      const HandleEdit edits[] = {Add({0.1 * (k + 1), 0, 0})};
      edited[k] = client().EditHandles(first_.binding_id, edits);
    });
  }
  for (std::thread& editor : editors) editor.join();
  int moved = 0;
  for (const auto& each : edited) {
    ASSERT_TRUE(each.ok()) << each.status();
    moved += static_cast<int>(each->moved.size());
  }
  EXPECT_EQ(moved, 1);
  EXPECT_EQ(client().GetSession(session)->revision, 1u);
}

// Random edits of a session that is being posed, each compared with the edited
// rig bound afresh, here, from the beginning.
class RandomEdits : public EditedHandlesTest,
                    public testing::WithParamInterface<const char*> {
 protected:
  double Some(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }
  int64_t Below(int64_t count) {
    return std::uniform_int_distribution<int64_t>(0, count - 1)(random_);
  }
  Vec3 Place() { return {Some(-1, 1), Some(-1, 1), Some(-1, 1)}; }
  // The first eight, around the ball, stay where they are.
  std::vector<HandleEdit> SomeEdits(int64_t handles) {
    const bool weighted = std::string(GetParam()) == "t_cc";
    std::vector<HandleEdit> edits;
    edits.push_back(Add(Place(), weighted ? Some(0, 0.5) : 0));
    if (handles > 10) edits.push_back(Remove(8 + Below(2)));
    if (handles > 12) edits.push_back(Move(10 + Below(2), Place()));
    return edits;
  }
  // Deforms with weights of no history.
  static Positions Afresh(const BindRequest& request, const Pose& pose) {
    Deformer deformer(deform::Bind(request, {}).value(), nullptr);
    deformer.MoveTo(pose);
    return deformer.positions();
  }

  std::mt19937 random_{11};
};

INSTANTIATE_TEST_SUITE_P(Schemes, RandomEdits, testing::Values("s_cc", "t_cc"),
                         [](const auto& test) { return test.param; });

TEST_P(RandomEdits, ShowWhatTheRigBoundAfreshShows) {
  const std::string scheme = GetParam();
  std::string binding = scheme == "s_cc"
                            ? first_.binding_id
                            : Bind(CubeHandles(), scheme).binding_id;
  auto stream = client().Deform(Session(binding), Delivery::kEvery).value();
  BindRequest request{.model = std::make_shared<const Mesh>(Ball()),
                      .rig = Handles::Create(3, Cube().vertices()).value(),
                      .scheme = scheme};
  Pose pose = stream.joined().pose;
  Frame frame = Await(stream, 0);
  uint64_t revision = 0;
  for (int round = 0; round < 25; ++round) {
    const auto& handles = std::get<Handles>(request.rig);
    // Someone drags a handle ...
    const auto dragged = static_cast<int32_t>(Below(handles.size()));
    const Vec3 to = pose.vertices.row(dragged).transpose() + 0.2 * Place();
    pose.vertices.row(dragged) = to.transpose();
    stream.Send({.vertices = {dragged}, .positions = to.transpose()}).value();
    frame = Await(stream, ++revision);
    ASSERT_LT(
        (frame.DoublePositions() - Afresh(request, pose)).cwiseAbs().maxCoeff(),
        2 * kFrameTolerance);
    // ... and handles are edited.
    const Positions before = frame.DoublePositions();
    const std::vector<HandleEdit> edits = SomeEdits(handles.size());
    const EditedHandles expected =
        deform::EditHandles(handles, request.options, edits).value();
    const EditedBinding edited = Edit(binding, edits);
    ASSERT_THAT(edited.moved, SizeIs(1));
    EXPECT_EQ(edited.previous, expected.previous);
    EXPECT_LT(edited.binding.quality.reproduction_error, 1e-6);
    frame = Await(stream, ++revision);
    request.rig = expected.handles;
    request.options = expected.options;
    const RigChange& change = stream.rig_changes().back();
    ASSERT_EQ(change.previous, expected.previous);
    pose = change.pose;
    const Positions after = frame.DoublePositions();
    ASSERT_LT((after - Afresh(request, pose)).cwiseAbs().maxCoeff(),
              2 * kFrameTolerance);
    const double diagonal = edited.binding.rig_diagonal;
    EXPECT_NEAR((after - before).rowwise().norm().maxCoeff() / diagonal,
                change.largest_jump, 4e-6);
    // What was left of the old binding is not needed any more.
    ASSERT_TRUE(client().DeleteBinding(binding).ok());
    binding = edited.binding.binding_id;
  }
}

}  // namespace
}  // namespace deform
