// Weights that are compressed while a session goes on, over a real connection.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "core/base/error.h"
#include "core/deform/columns.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

constexpr int64_t kPoints = 20'000;
constexpr double kTolerance = 1e-4;

// 42 vertices and 80 faces: dense weights take 9.8 MB.
Cage Rig() { return CageOf(Icosphere(1, 1)); }

// Within, and some of them close to the cage.
Mesh Cloud() {
  std::srand(1);
  Positions points = Positions::Random(kPoints, 3) * 0.45;
  return Mesh::Create(3, std::move(points), {}).value();
}

// The cage, squeezed and with one vertex pulled out.
Positions PosedCage(int step) {
  Positions vertices = Rig().vertices();
  vertices.col(2) *= 0.7;
  vertices.row(step % 42) *= 1 + 0.02 * (step % 20);
  return vertices;
}

// Everything in double, from weights computed here: no float, no compression.
class Reference {
 public:
  Reference() : columns_(Rig(), true) {
    const auto binding = Bind({.model = std::make_shared<const Mesh>(Cloud()),
                               .rig = Rig(),
                               .scheme = "green"},
                              {})
                             .value();
    weights_ = RecomputeWeights(*binding, 0, kPoints).value();
  }
  Positions Deformed(const Positions& vertices) const {
    Columns columns = columns_.rest();
    columns_.UpdateAll({.vertices = vertices}, columns);
    return weights_.vertex * columns.topRows(42) +
           weights_.normal * columns.bottomRows(80);
  }

 private:
  PosedColumns columns_;
  WeightBlock weights_;
};

class CompressionTest : public testing::Test {
 protected:
  BindingInfo BindTo(RunningServer& server, std::optional<double> tolerance) {
    const ModelInfo model =
        server.client().RegisterModel(Cloud(), "cloud").value();
    return server.client()
        .CreateBinding({.model_id = model.model_id,
                        .rig = Rig(),
                        .weight_tolerance = tolerance})
        .value();
  }
  // Asks again and again: a progress that only rises leads there.
  static BindingInfo AwaitForm(Client& client, const std::string& id,
                               WeightForm form) {
    for (;;) {
      const BindingInfo info = client.GetBinding(id).value();
      if (info.weight_form == form) return info;
      if (info.weight_form != WeightForm::kCompressing) {
        ADD_FAILURE() << "dense: " << info.why_dense;
        return info;
      }
      std::this_thread::yield();
    }
  }
};

TEST_F(CompressionTest, PosesStayWithinTheBoundAcrossTheChange) {
  RunningServer server;
  Client& client = server.client();
  const BindingInfo bound = BindTo(server, kTolerance);
  EXPECT_EQ(bound.weight_tolerance, kTolerance);
  const auto session = client.CreateSession(bound.binding_id).value();
  auto stream = client.Deform(session.session_id, Delivery::kEvery).value();
  const Reference reference;
  Frame frame;
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  // The largest displacement is below D, that of scaled normals below 2.
  const double allowed = (kTolerance + 1e-6) * bound.rig_diagonal;
  uint64_t revision = 0;
  const auto pose = [&] {
    const Positions vertices = PosedCage(static_cast<int>(revision));
    ASSERT_TRUE(stream.Send({.positions = vertices}).ok());
    ASSERT_TRUE(stream.NextFrame(frame).ok());
    EXPECT_EQ(frame.revision, ++revision);
    EXPECT_EQ(frame.skipped_revisions, 0u);
    const double error =
        (frame.DoublePositions() - reference.Deformed(vertices))
            .rowwise()
            .norm()
            .maxCoeff();
    EXPECT_LT(error, allowed) << "revision " << revision;
  };
  while (client.GetBinding(bound.binding_id)->weight_form !=
         WeightForm::kCompressed) {
    pose();
  }
  for (int k = 0; k < 5; ++k) pose();

  const BindingInfo info = client.GetBinding(bound.binding_id).value();
  EXPECT_GT(info.weight_error_bound, 0);
  EXPECT_LE(info.weight_error_bound, kTolerance);
  EXPECT_LT(info.weight_bytes, info.dense_weight_bytes / 2);
  EXPECT_DOUBLE_EQ(info.compression_ratio,
                   static_cast<double>(info.dense_weight_bytes) /
                       static_cast<double>(info.weight_bytes));
  EXPECT_EQ(info.why_dense, "");
  // One vertex, and the faces around it: moved columns alone.
  Positions one = PosedCage(static_cast<int>(revision) - 1).row(0) * 1.01;
  ASSERT_TRUE(stream.Send({.vertices = {0}, .positions = one}).ok());
  ASSERT_TRUE(stream.NextFrame(frame).ok());
  EXPECT_LE(frame.columns_applied, 1 + 6);
}

TEST_F(CompressionTest, CachedWeightsAreWrittenOutFromTheForm) {
  RunningServer server;
  Client& client = server.client();
  const BindingInfo dense = BindTo(server, 0);
  const BindingInfo bound = BindTo(server, kTolerance);
  EXPECT_NE(dense.binding_id, bound.binding_id);
  EXPECT_EQ(dense.weight_form, WeightForm::kDense);
  AwaitForm(client, bound.binding_id, WeightForm::kCompressed);
  const auto rows = [&](const BindingInfo& binding, WeightPrecision precision) {
    RowMatrix all;
    EXPECT_TRUE(client
                    .GetWeights(binding.binding_id, precision, 100, 50,
                                [&](const WeightRows& some) {
                                  all = some.vertex;
                                  return absl::OkStatus();
                                })
                    .ok());
    return all;
  };
  using enum WeightPrecision;
  const RowMatrix exact = rows(bound, kRecomputedFloat64);
  EXPECT_EQ(exact, rows(dense, kRecomputedFloat64));
  const double error =
      (exact - rows(bound, kCachedFloat32)).cwiseAbs().maxCoeff();
  EXPECT_GT(error, (exact - rows(dense, kCachedFloat32)).cwiseAbs().maxCoeff());
  EXPECT_LT(error, kTolerance);
}

TEST_F(CompressionTest, TheServersToleranceHoldsWhereNoneIsNamed) {
  server::Options options = TestOptions();
  options.weight_tolerance = {kTolerance};
  RunningServer server(options);
  const BindingInfo bound = BindTo(server, std::nullopt);
  EXPECT_EQ(bound.weight_tolerance, kTolerance);
  const BindingInfo again = BindTo(server, kTolerance);
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(again.binding_id, bound.binding_id);
  EXPECT_NE(server.BindBall().why_dense, "");
}

TEST_F(CompressionTest, ABindingMayBeDeletedWhileItIsCompressed) {
  RunningServer server;
  Client& client = server.client();
  for (int k = 0; k < 3; ++k) {
    const BindingInfo bound = BindTo(server, 1e-5);
    ASSERT_TRUE(client.DeleteBinding(bound.binding_id).ok());
    ASSERT_TRUE(client.DeleteModel(bound.model_id).ok());
  }
}

TEST_F(CompressionTest, ADrainDoesNotWaitForIt) {
  RunningServer server;
  BindTo(server, 1e-5);
  EXPECT_TRUE(server.server().Drain(std::chrono::seconds(60)));
}

TEST_F(CompressionTest, RefusesAToleranceThatNoFormCanKeep) {
  RunningServer server;
  const ModelInfo model = server.client().RegisterModel(Ball(), "").value();
  const absl::Status refused = server.client()
                                   .CreateBinding({.model_id = model.model_id,
                                                   .rig = Cube(),
                                                   .weight_tolerance = 0.5})
                                   .status();
  EXPECT_EQ(DetailOf(refused).reason, "WEIGHT_TOLERANCE_OUT_OF_RANGE");
  EXPECT_EQ(DetailOf(refused).field, "weight_tolerance");
  EXPECT_EQ(refused.message(),
            "weight tolerance must be 0 (dense weights) or in [1e-06, 0.01], "
            "not 0.5");
}

}  // namespace
}  // namespace deform
