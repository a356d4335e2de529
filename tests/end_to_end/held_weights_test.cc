// Clients that download what the server has, and deform by themselves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "client/cpp/deform_call.h"
#include "core/base/error.h"
#include "core/deform/deformer.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;

// Float weights and float frames; D of the cube is 3.5.
constexpr double kFrameTolerance = 2e-6 * 3.5;

TEST(DownloadModel, BringsTheArraysBitByBit) {
  RunningServer server;
  const Mesh large = MeshOf(Icosphere(1.0 / 3, 6));  // 40,962 points: 1.9 MB.
  Positions flat = Positions::Zero(5, 3);
  flat.leftCols(2).setRandom();
  const Mesh models[] = {Ball(), large,
                         Mesh::Create(2, flat, Faces(0, 3)).value()};
  for (const Mesh& model : models) {
    const ModelInfo info = server.client().RegisterModel(model, "m").value();
    int64_t last = 0;
    const ModelArrays arrays =
        server.client()
            .DownloadModel(info.model_id,
                           [&](int64_t done, int64_t total) {
                             EXPECT_LE(last, done);
                             EXPECT_LE(done, total);
                             last = done;
                             return true;
                           })
            .value();
    EXPECT_EQ(last,
              model.size() * model.dimension() * 8 + model.faces().size() * 4);
    EXPECT_EQ(arrays.dimension, model.dimension());
    EXPECT_EQ(arrays.positions, model.positions());
    EXPECT_EQ(arrays.faces, model.faces());
  }
}

TEST(DownloadModel, RefusesWhatIsNotThere) {
  RunningServer server;
  const auto answer = server.client().DownloadModel("nowhere");
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kNotFound);
}

TEST(DownloadModel, CanBeGivenUp) {
  RunningServer server;
  const ModelInfo info =
      server.client().RegisterModel(MeshOf(Icosphere(1, 6)), "m").value();
  const auto answer = server.client().DownloadModel(
      info.model_id, [](int64_t, int64_t) { return false; });
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kCancelled);
}

TEST(DownloadBinding, DeformsAsTheServerDoes) {
  RunningServer server;
  const BindingInfo info = server.BindBall();
  const HeldBinding held =
      server.client().DownloadBinding(info.binding_id).value();
  EXPECT_EQ(held.binding_id, info.binding_id);
  const auto compare = [&](const WeightRows& rows) {
    std::vector<float> ours(rows.vertex.rows() * held.binding->column_count());
    held.binding->CopyWeights(rows.first_point, rows.vertex.rows(),
                              ours.data());
    EXPECT_EQ(ours[0], static_cast<float>(rows.vertex(0, 0)));
    return absl::OkStatus();
  };
  EXPECT_TRUE(server.client()
                  .GetWeights(info.binding_id, WeightPrecision::kCachedFloat32,
                              0, 0, compare)
                  .ok());
  Deformer deformer(held.binding, nullptr);
  EXPECT_LT((deformer.positions() - Ball().positions()).norm(), 1e-14);
}

class HeldWeightsTest : public testing::Test {
 protected:
  HeldWeightsTest() : session_(server_.BallSession()) {}

  Client& client() { return server_.client(); }
  HeldBinding Download() {
    return client()
        .DownloadBinding(client().GetSession(session_)->binding_id)
        .value();
  }
  // The next frames of both are the same, but for roundings to float.
  void ExpectSame(DeformStream& holder, DeformStream& plain,
                  const std::string& encoding) {
    Frame frame, judge;
    ASSERT_TRUE(holder.NextFrame(frame).ok());
    ASSERT_TRUE(plain.NextFrame(judge).ok());
    EXPECT_EQ(frame.encoding, encoding);
    EXPECT_EQ(frame.revision, judge.revision);
    EXPECT_LT((frame.DoublePositions() - judge.DoublePositions())
                  .cwiseAbs()
                  .maxCoeff(),
              kFrameTolerance);
    bytes_ = frame.bytes;
  }
  static PoseUpdate Drag(int i) {
    PoseUpdate update{.vertices = {7}, .positions = Positions::Ones(1, 3)};
    update.positions(0, 0) += 0.5 * std::sin(0.1 * i);
    return update;
  }

  RunningServer server_;
  const std::string session_;
  int64_t bytes_ = 0;
};

TEST_F(HeldWeightsTest, PosesComeInsteadOfVertices) {
  auto plain = client().Deform(session_, Delivery::kEvery).value();
  auto holder = client()
                    .Deform(session_, {.delivery = Delivery::kEvery,
                                       .weights = Download()})
                    .value();
  EXPECT_EQ(holder.joined().encoding, "pose");
  ExpectSame(holder, plain, "pose");
  EXPECT_EQ(bytes_, 1 + 8 + 8 * 24);
  for (int i = 1; i < 50; ++i) {
    plain.Send(Drag(i)).value();
    ExpectSame(holder, plain, "pose");
    // One row of the pose.
    EXPECT_EQ(bytes_, 1 + 8 + 4 + 4 + 24);
  }
  plain.Send({.positions = 2 * Cube().vertices(), .stretch_blend = 0.5})
      .value();
  ExpectSame(holder, plain, "pose");
  EXPECT_EQ(bytes_, 1 + 8 + 8 * 24);
}

TEST_F(HeldWeightsTest, WeightsMayComeLater) {
  auto plain = client().Deform(session_, Delivery::kEvery).value();
  auto holder =
      client()
          .Deform(session_, {.delivery = Delivery::kEvery,
                             .tolerance_fraction = 1e-6,
                             .encodings = {"pose", "predicted", "float32"}})
          .value();
  ExpectSame(holder, plain, "predicted");
  ASSERT_TRUE(holder.Hold(Download()).ok());
  // Who holds weights is told so by the first frame in the other encoding.
  for (int i = 1; i < 3; ++i) {
    holder.Send(Drag(i)).value();
    ExpectSame(holder, plain, "pose");
  }
}

TEST_F(HeldWeightsTest, WeightsOfAnotherModelAreRefused) {
  const ModelInfo model =
      client().RegisterModel(MeshOf(Icosphere(0.5, 1)), "small").value();
  const BindingInfo other =
      client()
          .CreateBinding({.model_id = model.model_id, .rig = Cube()})
          .value();
  HeldBinding weights = client().DownloadBinding(other.binding_id).value();
  weights.binding_id = client().GetSession(session_)->binding_id;
  const auto refused = client().Deform(session_, {.weights = weights});
  EXPECT_EQ(DetailOf(refused.status()).reason, "OTHER_MODEL");
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("this binding is of a model with 42 points in 3D, "
                        "the session's has 162 in 3D"));
}

TEST_F(HeldWeightsTest, AfterARigChangeTheNewWeightsAreWanted) {
  const ModelInfo model = client().RegisterModel(Ball(), "ball").value();
  const RigArrays handles(RigKind::kHandles, 3, Cube().vertices(), Faces());
  const BindingInfo first =
      client()
          .CreateBinding(
              {.model_id = model.model_id, .rig = handles, .scheme = "s_cc"})
          .value();
  const std::string session =
      client().CreateSession(first.binding_id)->session_id;
  auto plain = client().Deform(session, Delivery::kEvery).value();
  auto holder =
      client()
          .Deform(
              session,
              {.delivery = Delivery::kEvery,
               .weights = client().DownloadBinding(first.binding_id).value()})
          .value();
  ExpectSame(holder, plain, "pose");
  const HandleEdit add{.kind = HandleEdit::Kind::kAdd, .position = {0, 0, 1.5}};
  const EditedBinding edited =
      client().EditHandles(first.binding_id, {&add, 1}).value();
  ExpectSame(holder, plain, "float32");
  ASSERT_EQ(holder.rig_changes().size(), 1u);
  ASSERT_TRUE(
      holder.Hold(client().DownloadBinding(edited.binding.binding_id).value())
          .ok());
  holder.Send({.vertices = {8}, .positions = Positions::Ones(1, 3)}).value();
  ExpectSame(holder, plain, "pose");
}

// A frame of a call, or why there is none.
class FirstFrame : public DeformEvents {
 public:
  void OnJoined(const JoinedSession& /*joined*/) override {}
  void OnFrame(const Frame& frame) override {
    MutexLock lock(mutex_);
    if (!encoding_) encoding_ = frame.encoding;
    changed_.NotifyAll();
  }
  void OnRejected(uint64_t /*sequence*/, const absl::Status&) override {}
  void OnRigChange(const RigChange& /*change*/) override {}
  void OnSent() override {}
  void OnEnd(const absl::Status& status) override {
    MutexLock lock(mutex_);
    if (!encoding_) encoding_ = std::string(status.message());
    changed_.NotifyAll();
  }
  std::string Wait() {
    MutexLock lock(mutex_);
    while (!encoding_) changed_.Wait(mutex_);
    return *encoding_;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  std::optional<std::string> encoding_ ABSL_GUARDED_BY(mutex_);
};

TEST_F(HeldWeightsTest, CallsTakePosesToo) {
  FirstFrame first;
  const auto call =
      client().StartDeform(session_, {.weights = Download()}, first);
  EXPECT_EQ(first.Wait(), "pose");
}

}  // namespace
}  // namespace deform
