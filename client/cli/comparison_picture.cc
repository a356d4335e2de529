#include "client/cli/comparison_picture.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/console.h"
#include "client/cli/quality_text.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

ColorScale ScaleOf(const Comparison& comparison) {
  double distortion = 1;
  std::vector<double> all;
  for (const ComparedScheme& scheme : comparison.schemes) {
    distortion = std::max(distortion, scheme.quality.pose->distortion_max);
    all.insert(all.end(), scheme.values.begin(), scheme.values.end());
  }
  if (comparison.color == "distortion") return DistortionScale(distortion);
  return LinearScale(all,
                     comparison.color == "influence"
                         ? absl::StrCat("weight of vertex ", comparison.handle)
                         : "displacement, model units");
}

std::string CaptionOf(const ComparedScheme& scheme) {
  const PoseQuality& pose = *scheme.quality.pose;
  std::string caption = absl::StrFormat(
      "%s\n%d %s, weights %s", scheme.name, scheme.binding.vertex_count,
      scheme.caged ? "cage vertices" : "handles",
      Seconds(scheme.binding.compute_seconds));
  if (pose.distortion_max > 1 + 1e-9) {
    absl::StrAppend(&caption,
                    absl::StrFormat("\nmax %.3g, p99 %.3g", pose.distortion_max,
                                    pose.distortion_p99));
  }
  if (pose.fold_overs > 0) {
    absl::StrAppend(&caption, ", ", Thousands(pose.fold_overs), " folded");
  }
  return caption;
}

// The time of each scheme's weights, as bars.
Chart TimeChart(const Comparison& comparison) {
  Chart chart{.title = "time of the weights, ms"};
  double low = 1e300, high = 1e-3;
  for (size_t k = 0; k < comparison.schemes.size(); ++k) {
    const double ms = 1e3 * comparison.schemes[k].binding.compute_seconds;
    low = std::min(low, ms);
    high = std::max(high, ms);
    const auto at = static_cast<double>(k);
    chart.bars.push_back({at + 0.2, at + 0.8, ms, CurveColor(k)});
    chart.x.labels.push_back(comparison.schemes[k].name);
  }
  chart.x.high = static_cast<double>(comparison.schemes.size());
  // Schemes may be a hundred times apart.
  chart.y.logarithmic = true;
  chart.y.low = std::max(0.3 * low, 1e-4);
  chart.y.high = 2 * high;
  return chart;
}

// Histograms with the same axes.
std::vector<Chart> HistogramsOf(const Comparison& comparison,
                                const ColorScale& scale) {
  std::vector<Chart> charts;
  double high = 0;
  for (const ComparedScheme& scheme : comparison.schemes) {
    charts.push_back(ValueChart(scheme.values, scale));
    high = std::max(high, charts.back().y.high);
  }
  for (Chart& chart : charts) chart.y.high = high;
  return charts;
}

}  // namespace

absl::StatusOr<Image> DrawComparison(const Comparison& comparison,
                                     const PictureOptions& options) {
  Picture picture;
  picture.dimension = comparison.dimension;
  picture.faces = comparison.faces;
  picture.rig_faces = comparison.cage_faces;
  picture.scale = ScaleOf(comparison);
  picture.panels.push_back(
      {.caption =
           absl::StrCat(comparison.title.empty() ? "at rest" : comparison.title,
                        "\n", Thousands(comparison.rest.rows()), " points"),
       .positions = comparison.rest,
       .rig = comparison.rest_rig,
       .rig_is_handles = !comparison.rest_caged});
  for (const ComparedScheme& scheme : comparison.schemes) {
    picture.panels.push_back({.caption = CaptionOf(scheme),
                              .positions = scheme.deformed,
                              .rig = scheme.rig,
                              .rig_is_handles = !scheme.caged,
                              .values = scheme.values});
  }
  const ColorScale scale = picture.scale;
  DEFORM_ASSIGN_OR_RETURN(const Image models,
                          DrawImage(options, std::move(picture)));
  std::vector<Chart> charts = HistogramsOf(comparison, scale);
  charts.insert(charts.begin(), TimeChart(comparison));
  std::vector<Image> row;
  for (Chart& chart : charts) {
    chart.width = options.width;
    chart.height = std::max(190, options.width * 2 / 5);
    row.push_back(DrawChart(chart));
  }
  return Stacked({models, DrawScale(scale, models.width, 84), Beside(row)});
}

}  // namespace deform::cli
