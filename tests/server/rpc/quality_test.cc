#include "server/rpc/quality.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

class QualityTaskOf : public testing::Test {
 protected:
  absl::StatusOr<QualityTask> Task(const v1::GetQualityRequest& request) {
    const auto record =
        rooms_.bindings().catalogue().Find("t", rooms_.binding_id).value();
    return ToQualityTask(request, "t", *record, sessions_);
  }
  // Reason and message of a refusal.
  std::string Refusal(const v1::GetQualityRequest& request) {
    const absl::Status status = Task(request).status();
    return absl::StrCat(DetailOf(status).reason, " ", DetailOf(status).field,
                        ": ", status.message());
  }

  SessionRooms rooms_;
  SessionManager sessions_{
      rooms_.bindings(), {.memory = 1 << 20, .count = 3}, rooms_.Environment()};
};

TEST_F(QualityTaskOf, ABindingHasNoPose) {
  const QualityTask task = Task({}).value();
  EXPECT_FALSE(task.posed.has_value());
  EXPECT_EQ(task.facts.point_count(), 42);
}

TEST_F(QualityTaskOf, APoseStartsAtRest) {
  v1::GetQualityRequest request;
  request.mutable_pose()->add_vertices(2);
  for (const double x : {5, 6, 7}) request.mutable_pose()->add_positions(x);
  request.mutable_pose()->set_stretch_blend(0.5);
  request.set_max_points(17);
  const QualityTask task = Task(request).value();
  ASSERT_TRUE(task.posed.has_value());
  EXPECT_EQ(task.posed->max_points, 17);
  EXPECT_EQ(task.posed->pose.stretch_blend, 0.5);
  Positions expected = BallCage().vertices();
  expected.row(2) << 5, 6, 7;
  EXPECT_EQ(task.posed->pose.vertices, expected);
}

TEST_F(QualityTaskOf, ASessionIsItsPresentPose) {
  const auto session = sessions_.Create("t", rooms_.binding_id, "s").value();
  v1::GetQualityRequest request;
  request.set_session_id("s");
  const QualityTask task = Task(request).value();
  ASSERT_TRUE(task.posed.has_value());
  EXPECT_EQ(task.posed->pose.vertices, BallCage().vertices());
  EXPECT_EQ(task.posed->max_points, PoseQualityRequest().max_points);
}

TEST_F(QualityTaskOf, NothingIsRefusedWithAReason) {
  v1::GetQualityRequest request;
  request.set_max_points(1000001);
  EXPECT_EQ(Refusal(request),
            "TOO_MANY_POINTS max_points: max_points is at most 1000000, not "
            "1000001");
  request.set_max_points(0);
  request.mutable_pose()->add_positions(1);
  EXPECT_THAT(Refusal(request), StartsWith("WRONG_LENGTH pose.positions: "));
  request.mutable_pose()->clear_positions();
  request.mutable_pose()->add_vertices(99);
  for (int i = 0; i < 3; ++i) request.mutable_pose()->add_positions(0);
  EXPECT_THAT(Refusal(request), HasSubstr("refers to vertex 99 of 8"));
  request.mutable_pose()->set_vertices(0, 1);
  request.mutable_pose()->set_positions(1, std::nan(""));
  EXPECT_THAT(Refusal(request), StartsWith("NON_FINITE pose.positions: "));
  request.set_session_id("s-none");
  EXPECT_THAT(Refusal(request), StartsWith("SESSION_NOT_FOUND"));
  request.set_session_id("no name");
  EXPECT_THAT(Refusal(request), StartsWith("BAD_NAME session_id: "));
}

TEST_F(QualityTaskOf, ASessionOfAnotherBindingIsRefused) {
  ASSERT_TRUE(sessions_.Create("t", rooms_.binding_id, "s").ok());
  const auto mine =
      rooms_.bindings().catalogue().Find("t", rooms_.binding_id).value();
  const BindingRecord other{.id = "b-other", .facts = mine->facts};
  v1::GetQualityRequest request;
  request.set_session_id("s");
  const absl::Status status =
      ToQualityTask(request, "t", other, sessions_).status();
  EXPECT_EQ(DetailOf(status).reason, "OTHER_BINDING");
  EXPECT_EQ(status.message(), absl::StrCat("session s poses binding ",
                                           rooms_.binding_id, ", not b-other"));
}

TEST(QualityReport, TellsEveryFigure) {
  Quality quality{.binding = {.weight_min = -0.5}, .rig_distance_min = 0.25};
  EXPECT_FALSE(ToProto(quality).has_pose());
  quality.pose = PoseQuality{.points = {{4, 1.5, 2}, {7, 3, -1}},
                             .sampled = true,
                             .near_rig = 2,
                             .fixed = 3,
                             .distortion_max = 3,
                             .distortion_p99 = 2.5,
                             .distortion_median = 1.5,
                             .most_distorted = 7,
                             .distortion = {{1, 2}, {1, 1}},
                             .fold_overs = 1,
                             .volume_change_min = -1,
                             .volume_change_median = 1,
                             .volume_change_max = 2,
                             .volume_kind = VolumeKind::kCapped,
                             .volume_rest = 10,
                             .volume_posed = 11};
  const v1::QualityReport report = ToProto(quality);
  EXPECT_EQ(report.binding().weight_min(), -0.5);
  EXPECT_EQ(report.rig_distance_min(), 0.25);
  const v1::PoseQuality& pose = report.pose();
  EXPECT_EQ(pose.point_count(), 2u);
  EXPECT_TRUE(pose.sampled());
  EXPECT_EQ(pose.near_rig_count(), 2u);
  EXPECT_EQ(pose.fixed_count(), 3u);
  EXPECT_EQ(pose.distortion_max(), 3);
  EXPECT_EQ(pose.distortion_p99(), 2.5);
  EXPECT_EQ(pose.distortion_median(), 1.5);
  EXPECT_EQ(pose.most_distorted_point(), 7u);
  EXPECT_THAT(pose.distortion_edges(), ElementsAre(1, 2));
  EXPECT_THAT(pose.distortion_counts(), ElementsAre(1, 1));
  EXPECT_EQ(pose.fold_over_count(), 1u);
  EXPECT_EQ(pose.volume_change_min(), -1);
  EXPECT_EQ(pose.volume_change_median(), 1);
  EXPECT_EQ(pose.volume_change_max(), 2);
  EXPECT_EQ(pose.volume_kind(), v1::VOLUME_KIND_CAPPED);
  EXPECT_EQ(pose.volume_rest(), 10);
  EXPECT_EQ(pose.volume_posed(), 11);
}

TEST(QualityReport, HasNoMostDistortedPointWithoutPoints) {
  Quality quality{.pose = PoseQuality()};
  EXPECT_FALSE(ToProto(quality).pose().has_most_distorted_point());
}

TEST(QualityPoints, FitOneMessage) {
  PoseQuality quality;
  for (int64_t i = 0; i < kQualityPointsPerMessage + 5; ++i) {
    quality.points.push_back({1000000000 + i, 1.0 + static_cast<double>(i), 1});
  }
  quality.points[3].volume_change = -1e300;
  const v1::QualityPoints first = ToProto(quality, 0);
  EXPECT_EQ(first.points_size(), kQualityPointsPerMessage);
  EXPECT_LE(first.ByteSizeLong(), size_t{1} << 20);
  EXPECT_TRUE(std::isfinite(first.volume_change(3)));
  const v1::QualityPoints last = ToProto(quality, kQualityPointsPerMessage);
  ASSERT_EQ(last.points_size(), 5);
  EXPECT_EQ(last.points(0), 1000000000u + kQualityPointsPerMessage);
  EXPECT_EQ(last.distortion(0), 1.0f + kQualityPointsPerMessage);
}

}  // namespace
}  // namespace deform::server
