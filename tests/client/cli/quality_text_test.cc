#include "client/cli/quality_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "client/cli/quality_picture.h"

namespace deform::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

QualityInfo Posed() {
  QualityInfo quality{.binding = {.reproduction_error = 1e-7,
                                  .weight_min = -0.25,
                                  .weight_max = 0.75},
                      .rig_distance_min = 0.02};
  quality.pose = PoseQuality{.points = {{0, 1.1, 1}, {2, 4, -0.5}},
                             .sampled = true,
                             .near_rig = 3,
                             .distortion_max = 4,
                             .distortion_p99 = 4,
                             .distortion_median = 1.1,
                             .most_distorted = 2,
                             .distortion = {{1, 2, 4}, {1, 0, 1}},
                             .fold_overs = 1,
                             .volume_change_min = -0.5,
                             .volume_change_max = 1,
                             .volume_kind = VolumeKind::kClosed,
                             .volume_rest = 8,
                             .volume_posed = 6};
  quality.points_measured = 2;
  return quality;
}

std::string Text(const QualityInfo& quality) {
  std::ostringstream out;
  Describe(quality, out);
  return out.str();
}

TEST(QualityText, TellsPeopleWhatMatters) {
  const std::string text = Text(Posed());
  EXPECT_THAT(text, HasSubstr("-0.25 to 0.75"));
  EXPECT_THAT(text, HasSubstr("2 points, a sample; 3 on the rig left out"));
  EXPECT_THAT(text, HasSubstr("median 1.1, p99 4, max 4 at point 2"));
  EXPECT_THAT(text, HasSubstr("fold-overs     1\n"));
  EXPECT_THAT(text, HasSubstr("8 at rest, 6 posed: -25.00 % (closed mesh)"));
  EXPECT_THAT(text, HasSubstr("1 to 2"));
  EXPECT_THAT(text, HasSubstr("from 4"));
  EXPECT_THAT(text, Not(HasSubstr("2 to 4")));  // Empty.
  EXPECT_THAT(text, Not(HasSubstr("solver")));
}

TEST(QualityText, OfABindingAloneSaysNothingOfAPose) {
  QualityInfo quality = Posed();
  quality.pose.reset();
  quality.binding.iterations_total = 12345;
  EXPECT_THAT(Text(quality), Not(HasSubstr("distortion")));
  EXPECT_THAT(Text(quality), HasSubstr("12,345 steps"));
  EXPECT_FALSE(ToJson(quality).contains("pose"));
}

TEST(QualityText, HasAllFiguresInJson) {
  const Json json = ToJson(Posed());
  EXPECT_EQ(json["binding"]["weight_min"], -0.25);
  EXPECT_EQ(json["rig_distance_min"], 0.02);
  EXPECT_EQ(json["pose"]["point_count"], 2);
  EXPECT_EQ(json["pose"]["distortion"]["max"], 4);
  EXPECT_EQ(json["pose"]["distortion"]["most_distorted_point"], 2);
  EXPECT_EQ(json["pose"]["distortion"]["histogram"][2]["from"], 4);
  EXPECT_EQ(json["pose"]["distortion"]["histogram"][2]["count"], 1);
  EXPECT_EQ(json["pose"]["fold_over_count"], 1);
  EXPECT_EQ(json["pose"]["volume"]["kind"], "closed");
  EXPECT_EQ(json["pose"]["volume"]["posed"], 6);
}

TEST(QualityPicture, LeavesPointsThatWereNotMeasuredWithoutAValue) {
  const auto values = DistortionOf(*Posed().pose, 3);
  ASSERT_EQ(values.size(), 3u);
  EXPECT_EQ(values[0], 1.1);
  EXPECT_TRUE(std::isnan(values[1]));
  EXPECT_EQ(values[2], 4);
}

TEST(QualityPicture, ScalesFitTheirValues) {
  EXPECT_EQ(DistortionScale(6).high, 6);
  EXPECT_EQ(DistortionScale(1).high, 1.5);
  EXPECT_EQ(DistortionScale(1e9).high, 1000);
  const ColorScale volume = VolumeScale(0.5, 1.2);
  EXPECT_DOUBLE_EQ(volume.PlaceOf(1), 0.5);
  EXPECT_EQ(volume.high, 2);
  const ColorScale weights = LinearScale({-0.5, 2, std::nan("")}, "w");
  EXPECT_EQ(weights.low, -0.5);
  EXPECT_EQ(weights.high, 2);
  EXPECT_EQ(LinearScale({3, 4}, "w").low, 0);
  EXPECT_GT(LinearScale({}, "w").high, LinearScale({}, "w").low);
}

TEST(QualityPicture, HistogramsAddUpToAllPoints) {
  const std::vector<double> values = {0, 0.25, 0.5, 1, std::nan("")};
  double sum = 0;
  for (const Bar& bar : ValueChart(values, LinearScale(values, "v")).bars) {
    sum += bar.height;
  }
  EXPECT_DOUBLE_EQ(sum, 1);
}

}  // namespace
}  // namespace deform::cli
