#include "core/quality/pose_quality.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <random>

#include "core/quality/rig_distance.h"
#include "tests/core/quality/posed.h"

namespace deform {
namespace {

using testing::Each;
using testing::SizeIs;

PoseQuality Measure(const std::shared_ptr<const Binding>& binding,
                    const Positions& vertices, int64_t max_points = 20000) {
  return MeasurePose(binding,
                     {.pose = {.vertices = vertices}, .max_points = max_points},
                     {})
      .value();
}

int64_t Sum(const std::vector<int64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), int64_t{0});
}

// Points of the tower, none nearer to its sides than a hundredth of D.
Shape TowerPoints(const Shape& cage) {
  const double gap = 0.01 * BoxOf(cage.positions).diagonal();
  Shape points{Positions(11 * 11 * 41, 3), Faces(0, 3)};
  int64_t row = 0;
  for (int i = 0; i <= 10; ++i) {
    for (int j = 0; j <= 10; ++j) {
      for (int k = 0; k <= 40; ++k) {
        const Vec3 t(i / 10.0, j / 10.0, k / 40.0);
        const Vec3 low(gap - 0.5, gap - 0.5, gap);
        const Vec3 high(0.5 - gap, 0.5 - gap, 8 - gap);
        points.positions.row(row++) =
            (low + t.cwiseProduct(high - low)).transpose();
      }
    }
  }
  return points;
}

// [L08] Fig. 8: what makes mean value coordinates shear. No bound holds for all
// cages, nor next to a cage; this is one tower, 0.01 D and more from its cage.
TEST(PoseQuality, OfATwistedTowerTellsGreenFromMeanValue) {
  const Shape cage = TowerCage();
  const Shape points = TowerPoints(cage);
  const Positions twisted = Twisted(cage.positions);
  const PoseQuality green =
      Measure(BindTo("green", points, CageOf(cage)), twisted);
  EXPECT_THAT(green.points, SizeIs(points.positions.rows()));
  EXPECT_LT(green.distortion_max, 7);
  EXPECT_GT(green.distortion_max, 3);
  EXPECT_EQ(green.fold_overs, 0);
  const PoseQuality mean_value =
      Measure(BindTo("mean_value", points, CageOf(cage)), twisted);
  EXPECT_GT(mean_value.distortion_max, 100);
  EXPECT_GT(mean_value.fold_overs, 0);
  EXPECT_LT(mean_value.volume_change_min, 0);
}

TEST(PoseQuality, OfGreenInThePlaneIsConformal) {
  Shape model = Grid2d(40);
  model.positions.leftCols<2>().array() -= 0.5;
  const auto binding = BindTo("green", model, CageOf(RegularLoop2d(1, 11)));
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.1);
  Positions pose = RegularLoop2d(1, 11).positions;
  for (double& x : pose.leftCols<2>().reshaped()) x += noise(random);
  const PoseQuality quality = Measure(binding, pose);
  EXPECT_LE(quality.distortion_max - 1, 1e-6);
  EXPECT_EQ(quality.distortion.counts[0], 41 * 41);
  EXPECT_EQ(quality.volume_kind, VolumeKind::kArea);
  EXPECT_NEAR(quality.volume_rest, 1, 1e-12);
  EXPECT_GT(quality.volume_change_max, quality.volume_change_min);
}

TEST(PoseQuality, OfASimilarityIsPerfect) {
  const auto binding = BindTo("green", Icosphere(0.8, 3),
                              CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})));
  const Positions pose = 2 * Cuboid({4, -1, -1}, {6, 1, 1}).positions;
  const PoseQuality quality = Measure(binding, pose);
  EXPECT_NEAR(quality.distortion_max, 1, 1e-12);
  EXPECT_NEAR(quality.volume_change_min, 8, 1e-11);
  EXPECT_NEAR(quality.volume_change_median, 8, 1e-11);
  EXPECT_NEAR(quality.volume_change_max, 8, 1e-11);
  EXPECT_EQ(quality.volume_kind, VolumeKind::kClosed);
  EXPECT_GT(quality.volume_rest, 2);
  EXPECT_NEAR(quality.volume_posed, 8 * quality.volume_rest, 1e-10);
  EXPECT_EQ(quality.fold_overs, 0);
  EXPECT_FALSE(quality.sampled);
}

// Handles reproduce affine maps: every figure is known.
TEST(PoseQuality, OfAnAffinePoseIsTheMapsOwn) {
  const Shape corners = Cuboid({-1, -1, -1}, {1, 1, 1});
  const auto binding = BindTo("s_cc", Icosphere(0.8, 3),
                              Handles::Create(3, corners.positions).value());
  Positions pose = corners.positions;
  pose.col(0) *= -3;  // Turned inside out,
  pose.col(1) *= 0.5;
  const PoseQuality quality = Measure(binding, pose);
  EXPECT_NEAR(quality.distortion_median, 6, 1e-8);
  EXPECT_NEAR(quality.distortion_max, 6, 1e-8);
  EXPECT_NEAR(quality.volume_change_median, -1.5, 1e-8);
  EXPECT_EQ(quality.fold_overs, 642);
  EXPECT_NEAR(quality.volume_posed, -1.5 * quality.volume_rest, 1e-6);
}

TEST(PoseQuality, OfAFlattenedModelIsBounded) {
  const Shape corners = Cuboid({-1, -1, -1}, {1, 1, 1});
  const auto binding = BindTo("s_cc", Icosphere(0.8, 1),
                              Handles::Create(3, corners.positions).value());
  for (const double size : {0.0, 1e100}) {
    Positions pose = corners.positions * (size == 0 ? 1 : size);
    pose.col(2).setZero();
    if (size == 0) pose.setZero();
    const PoseQuality quality = Measure(binding, pose);
    EXPECT_LE(quality.distortion_max, kMostDistorted);
    EXPECT_GT(quality.distortion_max, 1e6);
    EXPECT_TRUE(std::isfinite(quality.volume_change_min));
    EXPECT_TRUE(std::isfinite(quality.volume_change_max));
    EXPECT_TRUE(std::isfinite(quality.volume_posed));
    // Beyond what frames can hold there is no volume.
    EXPECT_EQ(quality.volume_kind,
              size == 0 ? VolumeKind::kClosed : VolumeKind::kNone);
    EXPECT_EQ(Sum(quality.distortion.counts), 42);
  }
}

TEST(PoseQuality, PutsEveryPointIntoABin) {
  const Shape cage = TowerCage();
  const PoseQuality quality =
      Measure(BindTo("mean_value", TowerPoints(cage), CageOf(cage)),
              Twisted(cage.positions));
  const std::vector<double>& edges = quality.distortion.edges;
  ASSERT_EQ(edges.size(), quality.distortion.counts.size());
  EXPECT_EQ(edges.front(), 1);
  EXPECT_NEAR(edges[10], 10, 1e-12);
  EXPECT_NEAR(edges.back(), 1000, 1e-9);
  EXPECT_EQ(Sum(quality.distortion.counts), std::ssize(quality.points));
  std::vector<int64_t> counts(edges.size(), 0);
  for (const PointQuality& point : quality.points) {
    size_t bin = edges.size() - 1;
    while (bin > 0 && point.distortion < edges[bin]) --bin;
    ++counts[bin];
  }
  EXPECT_EQ(counts, quality.distortion.counts);
}

TEST(PoseQuality, OrdersItsFigures) {
  const Shape cage = TowerCage();
  const PoseQuality quality =
      Measure(BindTo("green", TowerPoints(cage), CageOf(cage)),
              Twisted(cage.positions));
  std::vector<double> sorted;
  for (const PointQuality& point : quality.points) {
    sorted.push_back(point.distortion);
    if (point.point == quality.most_distorted) {
      EXPECT_EQ(point.distortion, quality.distortion_max);
    }
  }
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(quality.distortion_max, sorted.back());
  EXPECT_EQ(quality.distortion_median, sorted[sorted.size() / 2]);
  EXPECT_EQ(quality.distortion_p99,
            sorted[std::lround(0.99 * (sorted.size() - 1))]);
}

TEST(PoseQuality, OfALargeModelIsThatOfAFixedSample) {
  const Shape cage = TowerCage();
  const auto binding = BindTo("green", TowerPoints(cage), CageOf(cage));
  const Positions twisted = Twisted(cage.positions);
  const PoseQuality all = Measure(binding, twisted);
  const PoseQuality once = Measure(binding, twisted, 500);
  const PoseQuality again = Measure(binding, twisted, 500);
  EXPECT_TRUE(once.sampled);
  ASSERT_THAT(once.points, SizeIs(500));
  for (int i = 0; i < 500; ++i) {
    EXPECT_EQ(once.points[i].point, again.points[i].point);
    EXPECT_EQ(once.points[i].distortion, again.points[i].distortion);
    EXPECT_EQ(once.points[i].distortion,
              all.points[once.points[i].point].distortion);
    if (i == 0) continue;
    EXPECT_GT(once.points[i].point, once.points[i - 1].point);
  }
  // From all over the model.
  EXPECT_LT(once.points.front().point, 200);
  EXPECT_GT(once.points.back().point, 4700);
}

TEST(PoseQuality, CountsWhatItPassesOver) {
  Shape model{Positions(4, 3), Faces(0, 3)};
  model.positions << 0, 0, 0, 1, 0, 0, 1, 1, 1, 5, 0, 0;
  const Shape cube = Cuboid({-1, -1, -1}, {1, 1, 1});
  const PoseQuality quality =
      Measure(BindTo("green", model, CageOf(cube)), cube.positions);
  EXPECT_THAT(quality.points, SizeIs(1));
  EXPECT_EQ(quality.near_rig, 2);
  EXPECT_EQ(quality.fixed, 1);
  EXPECT_EQ(quality.volume_kind, VolumeKind::kNone);
}

TEST(PoseQuality, OfNoPointAtAllIsEmpty) {
  Shape model{Positions(1, 3), Faces(0, 3)};
  model.positions << 5, 0, 0;
  const Shape cube = Cuboid({-1, -1, -1}, {1, 1, 1});
  const PoseQuality quality =
      Measure(BindTo("green", model, CageOf(cube)), cube.positions);
  EXPECT_THAT(quality.points, SizeIs(0));
  EXPECT_EQ(quality.most_distorted, -1);
  EXPECT_EQ(quality.distortion_max, 1);
  EXPECT_THAT(quality.distortion.counts, Each(0));
}

TEST(PoseQuality, IsTheSameOnAnyNumberOfThreads) {
  const Shape corners = Icosphere(1, 0);
  const auto binding = BindTo("t_cc", Icosphere(0.6, 3),
                              Handles::Create(3, corners.positions).value());
  Positions pose = corners.positions;
  pose.row(3) *= 2;
  const PoseQuality serial = Measure(binding, pose);
  ThreadPool pool({.threads = 5});
  const PoseQuality parallel =
      MeasurePose(binding, {.pose = {.vertices = pose}}, {.pool = &pool})
          .value();
  ASSERT_EQ(serial.points.size(), parallel.points.size());
  for (size_t i = 0; i < serial.points.size(); ++i) {
    EXPECT_EQ(serial.points[i].distortion, parallel.points[i].distortion);
  }
  EXPECT_EQ(serial.distortion_p99, parallel.distortion_p99);
}

TEST(PoseQuality, TellsHowFarItIs) {
  const Shape cube = Cuboid({-1, -1, -1}, {1, 1, 1});
  const auto binding = BindTo("green", Icosphere(0.6, 3), CageOf(cube));
  const PoseQualityRequest request{.pose = RestPose(binding->rig()),
                                   .max_points = 100};
  EXPECT_EQ(PointsToMeasure(*binding, request), 100);
  EXPECT_EQ(PointsToMeasure(*binding, {.pose = request.pose}), 642);
  std::atomic<int64_t> done = 0;
  ASSERT_TRUE(MeasurePose(binding, request, {.points_done = &done}).ok());
  EXPECT_EQ(done, 100);
}

TEST(PoseQuality, CanBeCancelled) {
  const Shape cube = Cuboid({-1, -1, -1}, {1, 1, 1});
  const auto binding = BindTo("green", Icosphere(0.6, 3), CageOf(cube));
  Cancellation cancellation;
  cancellation.Cancel();
  EXPECT_TRUE(
      absl::IsCancelled(MeasurePose(binding, {.pose = RestPose(binding->rig())},
                                    {.cancellation = &cancellation})
                            .status()));
  EXPECT_TRUE(absl::IsCancelled(
      SmallestDistance(*binding, nullptr, &cancellation).status()));
}

}  // namespace
}  // namespace deform
