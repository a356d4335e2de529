#include "client/cli/quality_text.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/info_text.h"

namespace deform::cli {
namespace {

void Line(std::ostream& out, absl::string_view name, absl::string_view text) {
  out << absl::StrFormat("%-14s %s\n", name, text);
}

const char* VolumeKindName(VolumeKind kind) {
  switch (kind) {
    case VolumeKind::kClosed:
      return "closed";
    case VolumeKind::kCapped:
      return "capped";
    case VolumeKind::kArea:
      return "area";
    case VolumeKind::kNone:
      break;
  }
  return "none";
}

Json ToJson(const PoseQuality& pose, int64_t points) {
  Json bins = Json::array();
  for (size_t i = 0; i < pose.distortion.counts.size(); ++i) {
    bins.push_back({{"from", pose.distortion.edges[i]},
                    {"count", pose.distortion.counts[i]}});
  }
  Json distortion = {{"max", pose.distortion_max},
                     {"p99", pose.distortion_p99},
                     {"median", pose.distortion_median},
                     {"most_distorted_point", pose.most_distorted},
                     {"histogram", bins}};
  if (pose.most_distorted < 0) distortion["most_distorted_point"] = nullptr;
  return {{"point_count", points},
          {"sampled", pose.sampled},
          {"near_rig_count", pose.near_rig},
          {"fixed_count", pose.fixed},
          {"distortion", distortion},
          {"fold_over_count", pose.fold_overs},
          {"volume_change",
           {{"min", pose.volume_change_min},
            {"median", pose.volume_change_median},
            {"max", pose.volume_change_max}}},
          {"volume",
           {{"kind", VolumeKindName(pose.volume_kind)},
            {"rest", pose.volume_rest},
            {"posed", pose.volume_posed}}}};
}

// Bins that hold something, as bars of up to 40 signs.
void DescribeHistogram(const Histogram& histogram, std::ostream& out) {
  const auto& counts = histogram.counts;
  const int64_t most = *std::max_element(counts.begin(), counts.end());
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    // What is there is seen.
    const int64_t length = std::max<int64_t>(1, 40 * counts[i] / most);
    const std::string range =
        i + 1 < counts.size()
            ? absl::StrFormat("%.3g to %.3g", histogram.edges[i],
                              histogram.edges[i + 1])
            : absl::StrFormat("from %.3g", histogram.edges[i]);
    out << absl::StrFormat("  %-14s %9s %s\n", range, Thousands(counts[i]),
                           std::string(length, '#'));
  }
}

void DescribeBinding(const QualityInfo& quality, std::ostream& out) {
  const BindQuality& binding = quality.binding;
  Line(out, "reproduces",
       absl::StrFormat("the model to %.2g of the rig's diagonal",
                       binding.reproduction_error));
  Line(out, "weights",
       absl::StrFormat("%.3g to %.3g, sum to 1 within %.2g; largest sum of "
                       "|weight| %.3g",
                       binding.weight_min, binding.weight_max,
                       binding.partition_error, binding.weight_sum_max));
  Line(out, "nearest point",
       absl::StrFormat("%.3g of the diagonal from the rig",
                       quality.rig_distance_min));
  if (binding.iterations_total == 0) return;
  Line(out, "solver",
       absl::StrFormat("%s steps, %.1f a point, %d at most; residual %.2g, "
                       "%.2g at most",
                       Thousands(binding.iterations_total),
                       binding.iterations_mean, binding.iterations_max,
                       binding.residual_mean, binding.residual_max));
}

void DescribePose(const PoseQuality& pose, int64_t points, std::ostream& out) {
  std::string measured = absl::StrCat(Thousands(points), " points");
  if (pose.sampled) absl::StrAppend(&measured, ", a sample");
  if (pose.near_rig > 0) {
    absl::StrAppend(&measured, "; ", Thousands(pose.near_rig),
                    " on the rig left out");
  }
  if (pose.fixed > 0) {
    absl::StrAppend(&measured, "; ", Thousands(pose.fixed),
                    " without weights left out");
  }
  Line(out, "measured", measured);
  if (points > 0) {
    Line(out, "distortion",
         absl::StrFormat("%s at point %d (sigma_max / sigma_min)",
                         DistortionText(pose), pose.most_distorted));
    Line(out, "fold-overs", Thousands(pose.fold_overs));
    Line(out, "local volume",
         absl::StrFormat("x %.4g to %.4g, median %.4g", pose.volume_change_min,
                         pose.volume_change_max, pose.volume_change_median));
  }
  if (pose.volume_kind != VolumeKind::kNone) {
    Line(out, pose.volume_kind == VolumeKind::kArea ? "area" : "volume",
         absl::StrFormat("%.6g at rest, %.6g posed: %s (%s)", pose.volume_rest,
                         pose.volume_posed, VolumeChangeText(pose),
                         VolumeKindText(pose.volume_kind)));
  }
  if (points > 0) DescribeHistogram(pose.distortion, out);
}

}  // namespace

Json ToJson(const QualityInfo& quality) {
  Json json = {{"binding", ToJson(quality.binding)},
               {"rig_distance_min", quality.rig_distance_min}};
  if (quality.pose) {
    json["pose"] = ToJson(*quality.pose, quality.points_measured);
  }
  return json;
}

void Describe(const QualityInfo& quality, std::ostream& out) {
  DescribeBinding(quality, out);
  if (quality.pose) DescribePose(*quality.pose, quality.points_measured, out);
}

std::string DistortionText(const PoseQuality& pose) {
  return absl::StrFormat("median %.4g, p99 %.4g, max %.4g",
                         pose.distortion_median, pose.distortion_p99,
                         pose.distortion_max);
}

std::string VolumeChangeText(const PoseQuality& pose) {
  if (pose.volume_kind == VolumeKind::kNone) return "";
  const double percent = 100 * (pose.volume_posed / pose.volume_rest - 1);
  // Neither "-0.00" nor "+0.00".
  if (std::abs(percent) < 0.005) return "0.00 %";
  return absl::StrFormat("%+.2f %%", percent);
}

std::string VolumeKindText(VolumeKind kind) {
  switch (kind) {
    case VolumeKind::kClosed:
      return "closed mesh";
    case VolumeKind::kCapped:
      return "mesh with its holes closed";
    case VolumeKind::kArea:
      return "of the triangles";
    case VolumeKind::kNone:
      break;
  }
  return "";
}

}  // namespace deform::cli
