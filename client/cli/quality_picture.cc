#include "client/cli/quality_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/functional/function_ref.h"

namespace deform::cli {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

std::vector<double> Spread(
    const PoseQuality& pose, int64_t count,
    absl::FunctionRef<double(const PointQuality&)> value) {
  std::vector<double> values(count, kUnknown);
  for (const PointQuality& point : pose.points) {
    if (point.point < count) values[point.point] = value(point);
  }
  return values;
}

Axis ShareAxis(const std::vector<Bar>& bars) {
  double high = 0;
  for (const Bar& bar : bars) high = std::max(high, bar.height);
  return {.title = "share of the points", .low = 0, .high = 1.08 * high};
}

}  // namespace

ColorScale DistortionScale(double largest) {
  return {.low = 1,
          .high = std::clamp(largest, 1.5, 1000.0),
          .logarithmic = true,
          .title = "distortion, sigma_max / sigma_min"};
}

ColorScale VolumeScale(double smallest, double largest) {
  const double farthest = std::max(largest, smallest > 0 ? 1 / smallest : 10);
  const double high = std::clamp(farthest, 1.1, 10.0);
  return {.map = ColorMap::kDiverging,
          .low = 1 / high,
          .high = high,
          .logarithmic = true,
          .title = "local change of volume"};
}

ColorScale LinearScale(const std::vector<double>& values, std::string title) {
  double low = 0, high = 0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(high > low)) high = low + 1;
  return {.low = low, .high = high, .title = std::move(title)};
}

std::vector<double> DistortionOf(const PoseQuality& pose, int64_t count) {
  return Spread(pose, count,
                [](const PointQuality& point) { return point.distortion; });
}

std::vector<double> VolumeChangeOf(const PoseQuality& pose, int64_t count) {
  return Spread(pose, count,
                [](const PointQuality& point) { return point.volume_change; });
}

std::vector<double> DisplacementOf(const Positions& rest,
                                   const Positions& deformed) {
  const Eigen::VectorXd lengths = (deformed - rest).rowwise().norm();
  return std::vector<double>(lengths.begin(), lengths.end());
}

Chart ValueChart(const std::vector<double>& values, const ColorScale& scale) {
  constexpr int kBins = 40;
  std::vector<int64_t> counts(kBins, 0);
  int64_t total = 0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    ++total;
    ++counts[std::min(static_cast<int>(scale.PlaceOf(value) * kBins),
                      kBins - 1)];
  }
  const auto edge = [&](int i) {
    const double t = static_cast<double>(i) / kBins;
    return scale.logarithmic ? scale.low * std::pow(scale.high / scale.low, t)
                             : scale.low + t * (scale.high - scale.low);
  };
  Chart chart;
  for (int i = 0; i < kBins && total > 0; ++i) {
    if (counts[i] == 0) continue;
    chart.bars.push_back(
        {edge(i), edge(i + 1),
         static_cast<double>(counts[i]) / static_cast<double>(total),
         ColorAt(scale.map, (i + 0.5) / kBins)});
  }
  chart.x = {.title = scale.title,
             .logarithmic = scale.logarithmic,
             .low = scale.low,
             .high = scale.high};
  chart.y = ShareAxis(chart.bars);
  if (chart.bars.empty()) chart.y.high = 1;
  return chart;
}

}  // namespace deform::cli
