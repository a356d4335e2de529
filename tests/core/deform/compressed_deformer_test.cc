// Deforming with compressed weights.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "core/deform/deformer.h"
#include "core/weights/compress_binding.h"
#include "tests/core/deform/test_cages.h"

namespace deform {
namespace {

using BindingPtr = std::shared_ptr<const Binding>;

BindingPtr Dense(int points, int cells = 1,
                 Unbindable unbindable = Unbindable::kFail) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-0.95, 0.95);
  Positions positions =
      Positions::NullaryExpr(points, 3, [&] { return uniform(random); });
  if (unbindable == Unbindable::kReport) positions.row(7) << 5, 5, 5;
  return *Bind({.model = std::make_shared<const Mesh>(
                    *Mesh::Create(3, positions, Faces(0, 3))),
                .rig = BoxCage(cells),
                .scheme = "green",
                .unbindable = unbindable},
               {});
}

BindingPtr Compressed(const Binding& dense, double tolerance) {
  return *CompressBinding(dense, &dense.weights(), tolerance, {});
}

Pose RandomPose(const Binding& binding, unsigned seed, double size = 0.4) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  Pose pose = RestPose(binding.rig());
  for (double& x : pose.vertices.reshaped()) x += uniform(random);
  return pose;
}

double LargestDifference(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm().maxCoeff();
}

// Float sums of the dense form: 5e-7 of the extent, which is up to 4 here.
constexpr double kDenseRounding = 2e-6;

TEST(CompressedDeformer, IsExactAtRestAndInRigidMotion) {
  const BindingPtr dense = Dense(1000);
  Deformer deformer(Compressed(*dense, 1e-3), nullptr);
  EXPECT_EQ(deformer.positions(), dense->model()->positions());
  Pose moved = RestPose(dense->rig());
  moved.vertices.rowwise() += Eigen::RowVector3d(100, 0, -3);
  deformer.MoveTo(moved);
  Positions expected = dense->model()->positions();
  expected.rowwise() += Eigen::RowVector3d(100, 0, -3);
  EXPECT_LT(LargestDifference(deformer.positions(), expected), 1e-12);
  deformer.MoveTo(RestPose(dense->rig()), Deformer::Path::kFull);
  EXPECT_EQ(deformer.positions(), dense->model()->positions());
}

TEST(CompressedDeformer, StaysWithinTheErrorItReports) {
  const BindingPtr dense = Dense(3000, 2);
  for (const double tolerance : {1e-3, 1e-5}) {
    Deformer exact(dense, nullptr);
    Deformer deformer(Compressed(*dense, tolerance), nullptr);
    for (unsigned seed = 1; seed <= 10; ++seed) {
      Pose pose = RandomPose(*dense, seed, 0.1 * seed);
      pose.stretch_blend = seed % 3 / 2.0;
      EXPECT_EQ(exact.MoveTo(pose).error_bound, 0);
      const DeformReport report = deformer.MoveTo(pose);
      EXPECT_GT(report.error_bound, 0);
      EXPECT_LE(LargestDifference(deformer.positions(), exact.positions()),
                report.error_bound + kDenseRounding);
    }
  }
}

TEST(CompressedDeformer, AppliesOnlyMovedVerticesAndTheirFaces) {
  const BindingPtr dense = Dense(500, 4);
  Deformer deformer(Compressed(*dense, 1e-5), nullptr);
  Pose pose = RestPose(dense->rig());
  pose.vertices.row(5) *= 1.1;
  const Faces& faces = std::get<Cage>(dense->rig()).faces();
  const DeformReport report = deformer.MoveTo(pose);
  EXPECT_FALSE(report.full);
  EXPECT_EQ(report.columns_applied, 1 + (faces.array() == 5).count());
  EXPECT_EQ(deformer.MoveTo(pose).columns_applied, 0);
  EXPECT_TRUE(deformer.MoveTo(pose, Deformer::Path::kFull).full);
}

TEST(CompressedDeformer, StepsEqualFullPassesAfterManyRandomEdits) {
  const BindingPtr dense = Dense(200, 3);
  const BindingPtr binding = Compressed(*dense, 1e-4);
  Deformer deformer(binding, nullptr);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  std::uniform_int_distribution<int64_t> any(0, binding->vertex_count() - 1);
  const Positions& rest = RestVertices(binding->rig());
  Pose pose = RestPose(binding->rig());
  int64_t steps = 0;
  for (int edit = 1; edit <= 10000; ++edit) {
    const int64_t v = any(random);
    for (int d = 0; d < 3; ++d) {
      pose.vertices(v, d) = rest(v, d) + uniform(random);
    }
    steps += deformer.MoveTo(pose).full ? 0 : 1;
    if (edit % 1000 != 0) continue;
    // With the same similarity taken out, which is that of the last full pass.
    Deformer full(binding, nullptr);
    const DeformReport report = full.MoveTo(pose, Deformer::Path::kFull);
    EXPECT_LT(LargestDifference(deformer.positions(), full.positions()),
              1e-6 * DiagonalOf(binding->rig()) + 2 * report.error_bound);
  }
  EXPECT_GT(steps, 9000);
}

TEST(CompressedDeformer, LeavesUnboundPointsAtRest) {
  const BindingPtr dense = Dense(300, 1, Unbindable::kReport);
  Deformer deformer(Compressed(*dense, 1e-4), nullptr);
  deformer.MoveTo(RandomPose(*dense, 1));
  EXPECT_EQ(deformer.positions().row(7), dense->model()->positions().row(7));
  EXPECT_NE(deformer.positions().row(6), dense->model()->positions().row(6));
}

// Const calls may run at once.
TEST(CompressedDeformer, TellsTheSameLeafCoefficientsToManyAtOnce) {
  const BindingPtr dense = Dense(12000);
  ThreadPool pool({.threads = 3});
  Deformer deformer(Compressed(*dense, 1e-4), &pool);
  const int64_t rows = deformer.binding().compressed()->coefficient_rows();
  EXPECT_EQ(deformer.LeafCoefficients(), std::vector<float>(rows * 3, 0.0F));
  deformer.MoveTo(RandomPose(*dense, 1));
  std::vector<std::vector<float>> told(8);
  pool.ParallelFor(8, nullptr,
                   [&](int64_t i) { told[i] = deformer.LeafCoefficients(); });
  EXPECT_NE(told[0], std::vector<float>(rows * 3, 0.0F));
  for (const auto& coefficients : told) EXPECT_EQ(coefficients, told[0]);
}

TEST(CompressedDeformer, HasNoLeafCoefficientsWithDenseWeights) {
  EXPECT_TRUE(Deformer(Dense(100), nullptr).LeafCoefficients().empty());
}

TEST(CompressedDeformer, MovesTogetherAsAlone) {
  const BindingPtr binding = Compressed(*Dense(12000), 1e-4);
  ThreadPool pool({.threads = 3});
  std::vector<std::unique_ptr<Deformer>> together;
  std::vector<Pose> poses;
  std::vector<DeformJob> jobs;
  for (unsigned k = 0; k < 4; ++k) {
    together.push_back(std::make_unique<Deformer>(binding, nullptr));
    poses.push_back(RandomPose(*binding, k));
  }
  for (size_t k = 0; k < together.size(); ++k) {
    jobs.push_back({.deformer = together[k].get(), .pose = &poses[k]});
  }
  MoveTogether(jobs, &pool);
  for (size_t k = 0; k < together.size(); ++k) {
    Deformer alone(binding, nullptr);
    alone.MoveTo(poses[k]);
    EXPECT_EQ(together[k]->positions(), alone.positions());
  }
}

}  // namespace
}  // namespace deform
