#include "core/deform/deformer.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <vector>

#include "core/deform/moved_columns.h"
#include "tests/core/deform/test_cages.h"

namespace deform {
namespace {

// Points spread inside the box [-0.9, 0.9]^dimension.
Mesh PointsInside(int dimension, int count) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-0.9, 0.9);
  Positions points = Positions::Zero(count, 3);
  for (int i = 0; i < count; ++i) {
    for (int d = 0; d < dimension; ++d) points(i, d) = uniform(random);
  }
  return *Mesh::Create(dimension, points, Faces(0, 3));
}

std::shared_ptr<const Binding> BindGreen(
    Mesh model, const Cage& cage, Unbindable unbindable = Unbindable::kFail,
    const ExitRegions& exits = {}) {
  auto binding = Bind({.model = std::make_shared<const Mesh>(std::move(model)),
                       .rig = cage,
                       .scheme = "green",
                       .exits = exits,
                       .unbindable = unbindable},
                      {});
  EXPECT_TRUE(binding.ok()) << binding.status();
  return *binding;
}

std::shared_ptr<const Binding> InBox(int count = 100) {
  return BindGreen(PointsInside(3, count), BoxCage());
}

Pose RandomPose(const Binding& binding, unsigned seed, double size = 0.4) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  Pose pose = RestPose(binding.rig());
  for (int64_t v = 0; v < pose.vertices.rows(); ++v) {
    for (int d = 0; d < binding.dimension(); ++d) {
      pose.vertices(v, d) += uniform(random);
    }
  }
  return pose;
}

// Sum phi v' + sum psi s n' in double, without displacement form or float.
Positions Reference(const Binding& binding, const Pose& pose) {
  const auto weights = RecomputeWeights(binding, 0, binding.point_count());
  EXPECT_TRUE(weights.ok());
  const PosedColumns posed(binding.rig(), binding.scheme().uses_normals());
  Columns columns;
  posed.UpdateAll(pose, columns);
  const int64_t v = binding.vertex_count();
  return weights->vertex * columns.topRows(v) +
         weights->normal * columns.bottomRows(columns.rows() - v);
}

double LargestDifference(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm().maxCoeff();
}

TEST(Deformer, StartsAtTheRestPoseToTheBit) {
  const auto binding = InBox();
  EXPECT_EQ(Deformer(binding, nullptr).positions(),
            binding->model()->positions());
}

TEST(Deformer, ComesBackToTheRestPoseToTheBit) {
  const auto binding = InBox();
  Deformer deformer(binding, nullptr);
  deformer.MoveTo(RandomPose(*binding, 1));
  deformer.MoveTo(RestPose(binding->rig()), Deformer::Path::kFull);
  EXPECT_EQ(deformer.positions(), binding->model()->positions());
}

class DeformerInDimension : public testing::TestWithParam<int> {
 protected:
  std::shared_ptr<const Binding> Bound() const {
    return GetParam() == 2 ? BindGreen(PointsInside(2, 100), SquareCage())
                           : InBox();
  }
};

TEST_P(DeformerInDimension, AgreesWithTheDoubleSum) {
  const auto binding = Bound();
  Deformer deformer(binding, nullptr);
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Pose pose = RandomPose(*binding, seed);
    pose.stretch_blend = (seed % 3) / 2.0;
    const DeformReport report = deformer.MoveTo(pose);
    EXPECT_TRUE(report.full);
    // Float weights and sums: 5e-7 of the extent, which is 2 to 4 here.
    EXPECT_LT(
        LargestDifference(deformer.positions(), Reference(*binding, pose)),
        1e-6);
  }
}

TEST_P(DeformerInDimension, MovesTheModelByTheCagesSimilarity) {
  const auto binding = Bound();
  const bool planar = GetParam() == 2;
  const Vec3 axis = planar ? Vec3(0, 0, 1) : Vec3(Vec3(3, 1, 2).normalized());
  const Eigen::Matrix3d linear =
      2.5 * Eigen::AngleAxisd(1.1, axis).toRotationMatrix();
  const Eigen::RowVector3d offset(1e4, -3, planar ? 0 : 7);
  const auto moved = [&](const Positions& x) {
    Positions y = x * linear.transpose();
    y.rowwise() += offset;
    return y;
  };
  Deformer deformer(binding, nullptr);
  deformer.MoveTo({.vertices = moved(binding->rig().index() == 0
                                         ? RestVertices(binding->rig())
                                         : Positions())});
  // Rigid motion does not pass through float; 1e-16 of the offset is left.
  EXPECT_LT(LargestDifference(deformer.positions(),
                              moved(binding->model()->positions())),
            1e-11);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, DeformerInDimension,
                         testing::Values(2, 3));

TEST(Deformer, AppliesOnlyMovedVerticesAndTheirFaces) {
  const auto binding = BindGreen(PointsInside(3, 50), BoxCage(4));
  Deformer deformer(binding, nullptr);
  Pose pose = RestPose(binding->rig());
  pose.vertices.row(5) *= 1.1;
  const Faces& faces = std::get<Cage>(binding->rig()).faces();
  const int64_t incident = (faces.array() == 5).count();
  const DeformReport report = deformer.MoveTo(pose);
  EXPECT_FALSE(report.full);
  EXPECT_EQ(report.columns_applied, 1 + incident);
  EXPECT_LT(LargestDifference(deformer.positions(), Reference(*binding, pose)),
            1e-6);
}

TEST(Deformer, DoesNothingWhenNothingMoved) {
  const auto binding = InBox();
  Deformer deformer(binding, nullptr);
  const Pose pose = RandomPose(*binding, 1);
  deformer.MoveTo(pose);
  const Positions before = deformer.positions();
  EXPECT_EQ(deformer.MoveTo(pose).columns_applied, 0);
  EXPECT_EQ(deformer.positions(), before);
}

TEST(Deformer, StepsEqualFullPassesAfterManyRandomEdits) {
  const auto binding = BindGreen(PointsInside(3, 40), BoxCage(3));
  const double diagonal = DiagonalOf(binding->rig());
  Deformer deformer(binding, nullptr);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  std::uniform_int_distribution<int64_t> any(0, binding->vertex_count() - 1);
  const Positions& rest = RestVertices(binding->rig());
  Pose pose = RestPose(binding->rig());
  int64_t steps = 0;
  for (int edit = 1; edit <= 100000; ++edit) {
    const int64_t v = any(random);
    for (int d = 0; d < 3; ++d)
      pose.vertices(v, d) = rest(v, d) + uniform(random);
    if (edit % 1000 == 0) pose.stretch_blend = (edit / 1000 % 3) / 2.0;
    steps += deformer.MoveTo(pose).full ? 0 : 1;
    if (edit % 10000 == 0) {
      Deformer full(binding, nullptr);
      full.MoveTo(pose, Deformer::Path::kFull);
      EXPECT_LT(LargestDifference(deformer.positions(), full.positions()),
                1e-6 * diagonal);
    }
  }
  EXPECT_GT(steps, 90000);
}

TEST(Deformer, DragsEqualFullPasses) {
  const auto binding = BindGreen(PointsInside(3, 20000), BoxCage(2));
  ASSERT_GT(binding->weights().bytes(), MovedColumns::kWorthCopying);
  Deformer deformer(binding, nullptr);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  const Positions& rest = RestVertices(binding->rig());
  Pose pose = RestPose(binding->rig());
  int64_t added = 0;
  for (int drag = 0; drag < 12; ++drag) {
    // One participant drags a vertex, another a second one, in turns or at
    // once; some drags are of vertices that were dragged before.
    const int64_t first = drag % 7, second = (3 * drag) % 5 + 7;
    for (int step = 0; step < 8; ++step) {
      for (const int64_t v : {first, second}) {
        if (drag % 3 == 1 && step % 2 != v % 2) continue;
        if (drag % 3 == 2 && v == second) continue;
        for (int d = 0; d < 3; ++d) {
          pose.vertices(v, d) = rest(v, d) + uniform(random);
        }
      }
      added += deformer.MoveTo(pose).full ? 0 : 1;
    }
    Deformer full(binding, nullptr);
    full.MoveTo(pose, Deformer::Path::kFull);
    EXPECT_LT(LargestDifference(deformer.positions(), full.positions()),
              1e-6 * DiagonalOf(binding->rig()));
  }
  EXPECT_GT(added, 60);
}

TEST(Deformer, DragsShareTheMemoryThereIsForThem) {
  const auto binding = BindGreen(PointsInside(3, 20000), BoxCage(2));
  Pose pose = RestPose(binding->rig());
  const auto drag = [&](Deformer& deformer) {
    pose = RestPose(binding->rig());
    for (int step = 0; step < 4; ++step) {
      pose.vertices.row(0) += Vec3(0.01, 0, 0).transpose();
      deformer.MoveTo(pose);
    }
    return deformer.positions();
  };
  Allowance none(0);
  Deformer without(binding, nullptr, none);
  const Positions expected = drag(without);
  EXPECT_EQ(none.used(), 0);

  Allowance any(int64_t{1} << 30);
  Deformer with(binding, nullptr, any);
  EXPECT_LT(LargestDifference(drag(with), expected), 1e-6);
  EXPECT_GT(any.used(), 0);

  Allowance enough(any.used());  // For one of two.
  {
    Deformer first(binding, nullptr, enough), second(binding, nullptr, enough);
    EXPECT_LT(LargestDifference(drag(first), expected), 1e-6);
    EXPECT_EQ(enough.used(), enough.limit());
    EXPECT_LT(LargestDifference(drag(second), expected), 1e-6);
    EXPECT_EQ(enough.used(), enough.limit());
  }
  EXPECT_EQ(enough.used(), 0);
}

TEST(Deformer, FitsAnewWhenStepsHaveCarriedTheCageAway) {
  const auto binding = BindGreen(PointsInside(3, 40), BoxCage(3));
  const double diagonal = DiagonalOf(binding->rig());
  Deformer deformer(binding, nullptr);
  Pose pose = RestPose(binding->rig());
  // One vertex after the other moves 10^4 D away.
  for (int64_t v = 0; v < pose.vertices.rows(); ++v) {
    pose.vertices(v, 0) += 1e4 * diagonal;
    deformer.MoveTo(pose);
  }
  Positions expected = binding->model()->positions();
  expected.col(0).array() += 1e4 * diagonal;
  // 1e-16 of the offset, and the float weights of what is left of the pose.
  EXPECT_LT(LargestDifference(deformer.positions(), expected), 1e-6 * diagonal);
}

TEST(Deformer, KeepsItsDigitsFarFromTheOrigin) {
  const Vec3 far(1e6, -1e6, 1e6);
  Positions points = PointsInside(3, 50).positions();
  points.rowwise() += far.transpose();
  Positions vertices = BoxCage().vertices();
  vertices.rowwise() += far.transpose();
  const auto cage = Cage::Create(3, vertices, BoxCage().faces());
  ASSERT_TRUE(cage.ok());
  const auto binding = BindGreen(*Mesh::Create(3, points, Faces(0, 3)), *cage);
  Deformer deformer(binding, nullptr);
  const Pose pose = RandomPose(*binding, 2);
  deformer.MoveTo(pose);
  // One ulp of the coordinates is 1e-10.
  EXPECT_LT(LargestDifference(deformer.positions(), Reference(*binding, pose)),
            1e-6);
  std::vector<float> relative(3 * 50);
  deformer.CopyRelative(0, 50, far, relative.data());
  for (int i = 0; i < 50; ++i) {
    for (int d = 0; d < 3; ++d) {
      EXPECT_NEAR(relative[i * 3 + d], deformer.positions()(i, d) - far(d),
                  3e-7);  // Float of numbers below 4.
    }
  }
}

TEST(Deformer, StaysFiniteWhenFacesDegenerate) {
  const auto binding = InBox();
  Deformer deformer(binding, nullptr);
  Pose pose = RestPose(binding->rig());
  pose.vertices.row(1) = pose.vertices.row(0);  // Faces to segments.
  deformer.MoveTo(pose);
  EXPECT_TRUE(deformer.positions().allFinite());
  pose.vertices.setZero();  // Everything to a point.
  for (const double blend : {1.0, 0.0}) {
    pose.stretch_blend = blend;
    deformer.MoveTo(pose);
    EXPECT_TRUE(deformer.positions().allFinite());
  }
}

TEST(Deformer, LeavesUnboundPointsAtRest) {
  Positions points = PointsInside(3, 20).positions();
  points.row(7) << 5, 5, 5;
  const auto binding = BindGreen(*Mesh::Create(3, points, Faces(0, 3)),
                                 BoxCage(), Unbindable::kReport);
  Deformer deformer(binding, nullptr);
  Pose pose = RestPose(binding->rig());
  pose.vertices.col(0).array() += 1;
  deformer.MoveTo(pose);
  EXPECT_EQ(deformer.positions().row(7), points.row(7));
  EXPECT_NEAR(deformer.positions()(6, 0), points(6, 0) + 1, 1e-12);
}

TEST(Deformer, UsesItsPoolWithoutChangingABit) {
  const auto binding = InBox(20000);
  ThreadPool pool({.threads = 3});
  Deformer one(binding, nullptr);
  Deformer many(binding, &pool);
  const Pose pose = RandomPose(*binding, 4);
  one.MoveTo(pose);
  many.MoveTo(pose);
  EXPECT_EQ(one.positions(), many.positions());
}

TEST(MoveTogether, IsMoveToForEachOfSeveralSessions) {
  const auto binding = InBox(5000);
  ThreadPool pool({.threads = 3});
  const double diagonal = DiagonalOf(binding->rig());
  for (const size_t sessions : {1, 2, 5, 9}) {
    std::vector<std::unique_ptr<Deformer>> together, alone;
    for (size_t k = 0; k < sessions; ++k) {
      together.push_back(std::make_unique<Deformer>(binding, nullptr));
      alone.push_back(std::make_unique<Deformer>(binding, nullptr));
    }
    for (unsigned round = 0; round < 4; ++round) {
      std::vector<Pose> poses;
      for (size_t k = 0; k < sessions; ++k) {
        // Some jump, some move one vertex, some stay.
        Pose pose = together[k]->pose();
        if ((round + k) % 3 == 0) pose = RandomPose(*binding, round * 10 + k);
        if ((round + k) % 3 == 1) pose.vertices(3, 1) += 0.1;
        poses.push_back(pose);
      }
      std::vector<DeformJob> jobs;
      for (size_t k = 0; k < sessions; ++k) {
        jobs.push_back({.deformer = together[k].get(), .pose = &poses[k]});
      }
      MoveTogether(jobs, &pool);
      for (size_t k = 0; k < sessions; ++k) {
        const DeformReport report = alone[k]->MoveTo(poses[k]);
        EXPECT_EQ(jobs[k].report.full, report.full);
        EXPECT_EQ(jobs[k].report.columns_applied, report.columns_applied);
        // Float sums of 20 columns, in another order.
        EXPECT_LT(
            LargestDifference(together[k]->positions(), alone[k]->positions()),
            5e-7 * diagonal);
      }
    }
  }
}

TEST(MoveTogether, OfNobodyDoesNothing) { MoveTogether({}, nullptr); }

}  // namespace
}  // namespace deform
