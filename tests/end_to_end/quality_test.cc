// Quality reports from a live server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "core/base/error.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

Positions Widened(Positions vertices, double factor) {
  vertices.col(0) *= factor;
  return vertices;
}

TEST(QualityReport, OfABindingAloneHasNoPose) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  const QualityInfo quality =
      running.client().GetQuality({.binding_id = binding.binding_id}).value();
  EXPECT_FALSE(quality.pose.has_value());
  EXPECT_EQ(quality.binding.reproduction_error,
            binding.quality.reproduction_error);
  EXPECT_EQ(quality.binding.weight_max, binding.quality.weight_max);
  // A ball of radius 0.5 in a cube of half side 1 and diagonal 2 sqrt(3).
  EXPECT_NEAR(quality.rig_distance_min, 0.5 / (2 * std::sqrt(3)), 1e-12);
}

TEST(QualityReport, OfAPoseTellsItsDistortionAndVolume) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  const QualityInfo quality =
      running.client()
          .GetQuality(
              {.binding_id = binding.binding_id,
               .pose = PoseUpdate{.positions = Widened(Cube().vertices(), 2)},
               .with_points = true})
          .value();
  ASSERT_TRUE(quality.pose.has_value());
  const PoseQuality& pose = *quality.pose;
  EXPECT_EQ(quality.points_measured, 162);
  ASSERT_THAT(pose.points, SizeIs(162));
  // Green coordinates distort less than the cage.
  EXPECT_GT(pose.distortion_max, 1.05);
  EXPECT_LT(pose.distortion_max, 2);
  EXPECT_EQ(pose.fold_overs, 0);
  EXPECT_EQ(pose.volume_kind, VolumeKind::kClosed);
  EXPECT_GT(pose.volume_posed, 1.5 * pose.volume_rest);
  double largest = 0;
  for (const PointQuality& point : pose.points) {
    largest = std::max(largest, point.distortion);
  }
  EXPECT_FLOAT_EQ(largest, pose.distortion_max);
  EXPECT_FLOAT_EQ(pose.points[pose.most_distorted].distortion,
                  pose.distortion_max);
}

TEST(QualityReport, TakesTheNamedVerticesOfAPose) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  Positions corner(1, 3);
  corner << 2, 2, 2;
  const auto quality_of = [&](const PoseUpdate& pose) {
    return running.client()
        .GetQuality({.binding_id = binding.binding_id, .pose = pose})
        .value();
  };
  Positions all = Cube().vertices();
  all.row(7) = corner;
  const QualityInfo part = quality_of({.vertices = {7}, .positions = corner});
  EXPECT_EQ(part.pose->distortion_max,
            quality_of({.positions = all}).pose->distortion_max);
  EXPECT_THAT(part.pose->points, IsEmpty());  // Not asked for.
}

TEST(QualityReport, OfASessionIsThatOfItsPose) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  const std::string session =
      running.client().CreateSession(binding.binding_id).value().session_id;
  auto stream = running.client().Deform(session, Delivery::kEvery).value();
  const PoseUpdate wide{.positions = Widened(Cube().vertices(), 3)};
  const uint64_t sent = stream.Send(wide).value();
  Frame frame;
  do {
    ASSERT_TRUE(stream.NextFrame(frame).ok());
  } while (frame.answers_sequence < sent);
  const auto now =
      running.client()
          .GetQuality({.binding_id = binding.binding_id, .session_id = session})
          .value();
  const auto direct =
      running.client()
          .GetQuality({.binding_id = binding.binding_id, .pose = wide})
          .value();
  EXPECT_EQ(now.pose->distortion_max, direct.pose->distortion_max);
  EXPECT_GT(now.pose->distortion_max, 1.1);
}

TEST(QualityReport, OfALargeModelIsASample) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  const auto quality =
      running.client()
          .GetQuality(
              {.binding_id = binding.binding_id,
               .pose = PoseUpdate{.positions = Widened(Cube().vertices(), 2)},
               .max_points = 50,
               .with_points = true})
          .value();
  EXPECT_TRUE(quality.pose->sampled);
  EXPECT_EQ(quality.points_measured, 50);
  EXPECT_THAT(quality.pose->points, SizeIs(50));
}

TEST(QualityReport, IsRefusedWithReasons) {
  RunningServer running;
  const std::string id = running.BindBall().binding_id;
  const auto reason = [&](const QualityQuery& query) {
    return DetailOf(running.client().GetQuality(query).status()).reason;
  };
  EXPECT_EQ(reason({.binding_id = "b-none"}), "BINDING_NOT_FOUND");
  EXPECT_EQ(reason({.binding_id = id, .max_points = 2000000}),
            "TOO_MANY_POINTS");
  EXPECT_EQ(reason({.binding_id = id, .session_id = "s-none"}),
            "SESSION_NOT_FOUND");
  EXPECT_EQ(reason({.binding_id = id,
                    .pose = PoseUpdate{.positions = Positions::Zero(3, 3)}}),
            "WRONG_LENGTH");
  // Of another tenant it is not there.
  EXPECT_EQ(
      DetailOf(running.Connect("other").GetQuality({.binding_id = id}).status())
          .reason,
      "BINDING_NOT_FOUND");
}

TEST(QualityReport, GivesUpWhenItsCallerDoes) {
  RunningServer running;
  // Differences of mean value coordinates in a cage of 1280 faces: seconds.
  const ModelInfo model =
      running.client().RegisterModel(MeshOf(Icosphere(0.5, 4)), "ball").value();
  const BindingInfo binding =
      running.client()
          .CreateBinding({.model_id = model.model_id,
                          .rig = CageOf(Icosphere(1, 3)),
                          .scheme = "mean_value"})
          .value();
  int64_t total = 0;
  const auto quality = running.client().GetQuality(
      {.binding_id = binding.binding_id,
       .pose = PoseUpdate{.positions = Icosphere(2, 3).positions}},
      [&](int64_t done, int64_t all) {
        EXPECT_LE(done, all);
        total = all;
        return false;
      });
  EXPECT_TRUE(absl::IsCancelled(quality.status())) << quality.status();
  EXPECT_EQ(total, 2562);
}

TEST(QualityReport, DoesNotHoldSessionsUp) {
  RunningServer running;
  const BindingInfo binding = running.BindBall();
  const std::string session =
      running.client().CreateSession(binding.binding_id).value().session_id;
  auto stream = running.client().Deform(session, Delivery::kEvery).value();
  // Reports one after the other beside a stream that is answered all along.
  std::thread reporter([&] {
    for (int i = 0; i < 20; ++i) {
      EXPECT_TRUE(running.client()
                      .GetQuality({.binding_id = binding.binding_id,
                                   .session_id = session})
                      .ok());
    }
  });
  Frame frame;
  for (int i = 0; i < 50; ++i) {
    const uint64_t sent =
        stream.Send({.positions = Widened(Cube().vertices(), 1 + 0.01 * i)})
            .value();
    do {
      ASSERT_TRUE(stream.NextFrame(frame).ok());
    } while (frame.answers_sequence < sent);
  }
  reporter.join();
}

}  // namespace
}  // namespace deform
