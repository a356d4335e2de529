#include "client/cpp/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/error.h"

namespace deform {
namespace {

using testing::ElementsAre;

Positions Rows(std::initializer_list<std::array<double, 3>> rows) {
  Positions result(rows.size(), 3);
  int i = 0;
  for (const auto& row : rows) result.row(i++) << row[0], row[1], row[2];
  return result;
}

TEST(ModelBytes, HoldsDoublesThenCornersWhereverItIsCut) {
  Faces faces(1, 3);
  faces << 0, 2, 1;
  const ModelBytes bytes(
      ModelArrays(3, Rows({{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}), faces));
  ASSERT_EQ(bytes.size(), 9 * 8 + 3 * 4);
  const std::string whole = bytes.Range(0, bytes.size());
  for (int64_t cut = 1; cut < bytes.size(); ++cut) {
    EXPECT_EQ(bytes.Range(0, cut) + bytes.Range(cut, bytes.size() - cut), whole)
        << cut;
  }
  double last = 0;
  std::memcpy(&last, whole.data() + 64, 8);
  EXPECT_EQ(last, 9);
  uint32_t corner = 0;
  std::memcpy(&corner, whole.data() + 76, 4);
  EXPECT_EQ(corner, 2u);
}

TEST(ModelBytes, LeavesTheThirdColumnOutIn2d) {
  EXPECT_EQ(ModelBytes(ModelArrays(2, Rows({{1, 2, 0}}), Faces())).size(), 16);
}

TEST(BindingRequest, CarriesWrongNumbersToTheServerAsTheyAre) {
  BindingSpec spec;
  spec.rig.vertices =
      Rows({{std::nan(""), std::numeric_limits<double>::infinity(), 0}});
  spec.rig.faces.resize(1, 3);
  spec.rig.faces << 0, -1, 99;
  const v1::CreateBindingRequest request = ToProto(spec, "t");
  EXPECT_TRUE(std::isnan(request.rig().cage().vertices(0)));
  EXPECT_TRUE(std::isinf(request.rig().cage().vertices(1)));
  EXPECT_THAT(request.rig().cage().corners(), ElementsAre(0, 0xffffffffu, 99));
}

TEST(BindingRequest, SaysHowOutsidePointsAreReached) {
  BindingSpec spec;
  EXPECT_FALSE(ToProto(spec, "").has_exits());
  spec.exits.kind = ExitRegions::Kind::kAutomatic;
  EXPECT_TRUE(ToProto(spec, "").exits().has_automatic());
  spec.exits.kind = ExitRegions::Kind::kPerPoint;
  spec.exits.face_of_point = {-1, 4};
  EXPECT_THAT(ToProto(spec, "").exits().per_point().faces(),
              ElementsAre(-1, 4));
  spec.exits.kind = ExitRegions::Kind::kFaces;
  spec.exits.faces = {3};
  EXPECT_THAT(ToProto(spec, "").exits().faces().faces(), ElementsAre(3));
}

TEST(BindingRequest, KeepsHandlesAndTheirWeights) {
  BindingSpec spec;
  spec.rig = RigArrays(RigKind::kHandles, 2, Rows({{1, 2, 0}, {3, 4, 0}}), {});
  spec.options.handle_weights = {0.5, 0};
  const v1::CreateBindingRequest request = ToProto(spec, "");
  EXPECT_THAT(request.rig().handles().positions(), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(request.options().handle_weights(), ElementsAre(0.5, 0));
}

TEST(BindingRequest, KeepsFixedHandlesTheBoxAndClampedPoints) {
  BindingSpec spec;
  spec.rig = RigArrays(RigKind::kHandles, 2, Rows({{1, 2, 0}}), {});
  spec.rig.fixed = Rows({{5, 6, 0}});
  spec.add_box_handles = true;
  spec.clamped = {4, 7};
  const v1::CreateBindingRequest request = ToProto(spec, "");
  EXPECT_THAT(request.rig().handles().fixed_positions(), ElementsAre(5, 6));
  EXPECT_TRUE(request.add_box_handles());
  EXPECT_THAT(request.clamped_points(), ElementsAre(4, 7));
  const RigArrays back = FromProto(request.rig()).value();
  EXPECT_EQ(back.vertices, spec.rig.vertices);
  EXPECT_EQ(back.fixed, spec.rig.fixed);
}

TEST(BindingRequest, CarriesTheWeightToleranceOnlyWhenItIsSet) {
  BindingSpec spec;
  EXPECT_FALSE(ToProto(spec, "t").has_weight_tolerance());
  spec.weight_tolerance = 0;
  EXPECT_TRUE(ToProto(spec, "t").has_weight_tolerance());
  spec.weight_tolerance = 1e-4;
  EXPECT_EQ(ToProto(spec, "t").weight_tolerance(), 1e-4);
}

TEST(FormOfABinding, IsReadFigureByFigure) {
  v1::Binding binding;
  EXPECT_EQ(FromProto(binding).weight_form, WeightForm::kUnknown);
  binding.set_weight_form(v1::WEIGHT_FORM_DENSE);
  EXPECT_EQ(FromProto(binding).weight_form, WeightForm::kDense);
  binding.set_weight_form(v1::WEIGHT_FORM_COMPRESSING);
  EXPECT_EQ(FromProto(binding).weight_form, WeightForm::kCompressing);
  binding.set_weight_form(v1::WEIGHT_FORM_COMPRESSED);
  binding.set_weight_tolerance(1e-4);
  binding.set_weight_error_bound(0.5e-4);
  binding.set_dense_weight_bytes(30);
  binding.set_compression_ratio(3);
  binding.set_why_dense("no");
  const BindingInfo info = FromProto(binding);
  EXPECT_EQ(info.weight_form, WeightForm::kCompressed);
  EXPECT_EQ(info.weight_tolerance, 1e-4);
  EXPECT_EQ(info.weight_error_bound, 0.5e-4);
  EXPECT_EQ(info.dense_weight_bytes, 30);
  EXPECT_EQ(info.compression_ratio, 3);
  EXPECT_EQ(info.why_dense, "no");
}

TEST(PoseMessage, CarriesTheBlendOnlyWhenItIsSet) {
  PoseUpdate update{.vertices = {4}, .positions = Rows({{1, 2, 3}})};
  EXPECT_FALSE(ToProto(update, 3, 1).has_stretch_blend());
  update.stretch_blend = 0;
  const v1::Pose pose = ToProto(update, 3, 9);
  EXPECT_TRUE(pose.has_stretch_blend());
  EXPECT_EQ(pose.sequence(), 9u);
  EXPECT_THAT(pose.vertices(), ElementsAre(4));
  EXPECT_THAT(pose.positions(), ElementsAre(1, 2, 3));
}

TEST(Weights, FloatsAndDoublesAreSplitIntoVertexAndNormalColumns) {
  v1::GetWeightsResponse response;
  response.set_point_count(1);
  response.set_vertex_count(2);
  response.set_normal_count(1);
  const float row[] = {0.25f, 0.75f, -1.5f};
  response.set_data(row, sizeof(row));
  const WeightRows rows = FromProto(response).value();
  EXPECT_EQ(rows.vertex(0, 1), 0.75);
  EXPECT_EQ(rows.normal(0, 0), -1.5);
}

TEST(Weights, BytesThatDoNotMakeRowsAreRefused) {
  v1::GetWeightsResponse response;
  response.set_point_count(2);
  response.set_vertex_count(2);
  response.set_data(std::string(12, 'x'));
  EXPECT_FALSE(FromProto(response).ok());
  response.set_vertex_count(0);
  EXPECT_FALSE(FromProto(response).ok());
}

TEST(QualityOfABinding, IsReadFigureByFigure) {
  v1::BindingQuality message;
  message.set_reproduction_error(1);
  message.set_partition_error(2);
  message.set_weight_min(-3);
  message.set_weight_max(4);
  message.set_weight_sum_max(5);
  message.set_iterations_total(uint64_t{6} << 32);
  message.set_iterations_max(7);
  message.set_iterations_mean(8);
  message.set_residual_max(9);
  message.set_residual_mean(10);
  const BindQuality quality = FromProto(message);
  EXPECT_EQ(quality.reproduction_error, 1);
  EXPECT_EQ(quality.partition_error, 2);
  EXPECT_EQ(quality.weight_min, -3);
  EXPECT_EQ(quality.weight_max, 4);
  EXPECT_EQ(quality.weight_sum_max, 5);
  EXPECT_EQ(quality.iterations_total, int64_t{6} << 32);
  EXPECT_EQ(quality.iterations_max, 7);
  EXPECT_EQ(quality.iterations_mean, 8);
  EXPECT_EQ(quality.residual_max, 9);
  EXPECT_EQ(quality.residual_mean, 10);
}

TEST(QualityOfAPose, IsReadFigureByFigure) {
  v1::QualityReport message;
  message.set_rig_distance_min(0.5);
  EXPECT_FALSE(FromProto(message).pose.has_value());
  v1::PoseQuality& pose = *message.mutable_pose();
  pose.set_point_count(9);
  pose.set_sampled(true);
  pose.set_near_rig_count(2);
  pose.set_fixed_count(3);
  pose.set_distortion_max(4);
  pose.set_distortion_p99(5);
  pose.set_distortion_median(6);
  pose.add_distortion_edges(1);
  pose.add_distortion_counts(9);
  pose.set_fold_over_count(7);
  pose.set_volume_change_min(-8);
  pose.set_volume_change_median(8);
  pose.set_volume_change_max(9);
  pose.set_volume_kind(v1::VOLUME_KIND_CAPPED);
  pose.set_volume_rest(10);
  pose.set_volume_posed(11);
  const QualityInfo info = FromProto(message);
  EXPECT_EQ(info.rig_distance_min, 0.5);
  EXPECT_EQ(info.points_measured, 9);
  ASSERT_TRUE(info.pose.has_value());
  EXPECT_TRUE(info.pose->sampled);
  EXPECT_EQ(info.pose->near_rig, 2);
  EXPECT_EQ(info.pose->fixed, 3);
  EXPECT_EQ(info.pose->distortion_max, 4);
  EXPECT_EQ(info.pose->distortion_p99, 5);
  EXPECT_EQ(info.pose->distortion_median, 6);
  EXPECT_EQ(info.pose->most_distorted, -1);
  EXPECT_EQ(info.pose->distortion.edges, std::vector<double>{1});
  EXPECT_EQ(info.pose->distortion.counts, std::vector<int64_t>{9});
  EXPECT_EQ(info.pose->fold_overs, 7);
  EXPECT_EQ(info.pose->volume_change_min, -8);
  EXPECT_EQ(info.pose->volume_change_median, 8);
  EXPECT_EQ(info.pose->volume_change_max, 9);
  EXPECT_EQ(info.pose->volume_kind, VolumeKind::kCapped);
  EXPECT_EQ(info.pose->volume_rest, 10);
  EXPECT_EQ(info.pose->volume_posed, 11);
  pose.set_most_distorted_point(5);
  EXPECT_EQ(FromProto(message).pose->most_distorted, 5);
}

TEST(QualityOfAPose, IsRefusedIfItsPointsDoNotFit) {
  v1::QualityPoints points;
  points.add_points(3);
  points.add_distortion(1.5);
  QualityInfo info;
  info.pose.emplace();
  EXPECT_EQ(DetailOf(AddPoints(points, info)).reason, "BAD_ANSWER");
  points.add_volume_change(2);
  ASSERT_TRUE(AddPoints(points, info).ok());
  ASSERT_EQ(info.pose->points.size(), 1u);
  EXPECT_EQ(info.pose->points[0].point, 3);
  EXPECT_EQ(info.pose->points[0].distortion, 1.5);
  EXPECT_EQ(info.pose->points[0].volume_change, 2);
  info.pose.reset();
  EXPECT_EQ(DetailOf(AddPoints(points, info)).reason, "BAD_ANSWER");
}

TEST(RigOfABinding, IsReadBackAsItWasSent) {
  Faces faces(2, 2);
  faces << 0, 1, 1, 0;
  BindingSpec spec;
  spec.rig = RigArrays(RigKind::kCage, 2, Rows({{1, 2, 0}, {3, 4, 0}}), faces);
  const RigArrays back = FromProto(ToProto(spec, "").rig()).value();
  EXPECT_EQ(back.dimension, 2);
  EXPECT_EQ(back.vertices, spec.rig.vertices);
  EXPECT_EQ(back.faces, faces);
}

TEST(RigOfABinding, IsRefusedIfItsNumbersDoNotFit) {
  v1::Rig rig;
  EXPECT_FALSE(FromProto(rig).ok());
  rig.mutable_cage()->set_dimension(3);
  rig.mutable_cage()->add_vertices(1);
  EXPECT_FALSE(FromProto(rig).ok());
}

TEST(JoinedMessage, NeedsAPoseOfItsVertexCount) {
  v1::Joined joined;
  joined.set_dimension(3);
  joined.set_vertex_count(2);
  for (int i = 0; i < 3; ++i) joined.add_pose(i);
  EXPECT_FALSE(FromProto(joined).ok());
  joined.set_vertex_count(1);
  EXPECT_EQ(FromProto(joined).value().pose.vertices(0, 2), 2);
  joined.set_point_count(~uint64_t{0});
  EXPECT_FALSE(FromProto(joined).ok());
}

}  // namespace
}  // namespace deform
