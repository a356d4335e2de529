#include "client/cli/load_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "client/pictures/chart.h"

namespace deform::cli {
namespace {

// Axes end at powers of ten.
double DecadeBelow(double value) {
  return std::pow(10, std::floor(std::log10(std::max(value, 1e-3))));
}
double DecadeAbove(double value) {
  return std::pow(10, std::floor(std::log10(std::max(value, 1e-3))) + 1);
}

Image OverTime(const LoadReport& report, const LatencyHistogram& all) {
  Chart chart;
  chart.title = "Pose to frame";
  chart.x = {
      .title = "seconds", .low = 0, .high = std::max(report.seconds, 1e-3)};
  chart.y = {.title = "milliseconds",
             .logarithmic = true,
             .low = DecadeBelow(Milliseconds(all.Percentile(0.01))),
             .high = DecadeAbove(Milliseconds(all.max()))};
  const auto& intervals = report.figures.intervals;
  const auto add = [&](const char* name, auto value) {
    Curve curve{.name = name,
                .color = CurveColor(chart.curves.size()),
                .dots = intervals.size() < 40};
    const double width =
        intervals.size() > 1 ? intervals[1].begin : report.seconds;
    for (const LoadFigures::Interval& interval : intervals) {
      curve.x.push_back(interval.begin + 0.5 * width);
      curve.y.push_back(interval.latency.count() > 0
                            ? Milliseconds(value(interval.latency))
                            : std::numeric_limits<double>::quiet_NaN());
    }
    chart.curves.push_back(std::move(curve));
  };
  add("p50", [](const LatencyHistogram& h) { return h.Percentile(0.5); });
  add("p99", [](const LatencyHistogram& h) { return h.Percentile(0.99); });
  add("max", [](const LatencyHistogram& h) { return h.max(); });
  return DrawChart(chart);
}

Image HowOften(const LatencyHistogram& all) {
  constexpr int kPerDecade = 20;
  const double low = DecadeBelow(Milliseconds(all.Percentile(0.01)));
  const double high = DecadeAbove(Milliseconds(all.max()));
  Chart chart;
  chart.title = "How often";
  chart.x = {
      .title = "milliseconds", .logarithmic = true, .low = low, .high = high};
  const auto above = [&](double ms) {
    return static_cast<double>(all.CountAbove(
        std::chrono::nanoseconds(static_cast<int64_t>(1e6 * ms))));
  };
  const auto count = static_cast<double>(std::max<int64_t>(1, all.count()));
  double most = 0;
  const double step = std::pow(10, 1.0 / kPerDecade);
  for (double from = low; from < 0.999 * high; from *= step) {
    const double percent = 100 * (above(from) - above(from * step)) / count;
    chart.bars.push_back({from, from * step, percent, CurveColor(0)});
    most = std::max(most, percent);
  }
  chart.y = {
      .title = "percent of all", .low = 0, .high = std::max(1.05 * most, 1.0)};
  return DrawChart(chart);
}

Image ServerOverTime(const LoadReport& report, const char* title,
                     int64_t ServerSample::*what, double unit) {
  Curve curve{.color = CurveColor(0)};
  double most = 0;
  for (const ServerSample& sample : report.server_over_time) {
    curve.x.push_back(sample.seconds);
    curve.y.push_back(static_cast<double>(sample.*what) / unit);
    most = std::max(most, curve.y.back());
  }
  Chart chart;
  chart.title = title;
  chart.x = {
      .title = "seconds", .low = 0, .high = std::max(report.seconds, 1e-3)};
  chart.y = {.low = 0, .high = std::max(1.25 * most, 1.0)};
  chart.curves.push_back(std::move(curve));
  chart.height = 180;
  return DrawChart(chart);
}

}  // namespace

Image DrawLoad(const LoadReport& report) {
  const LatencyHistogram all = report.figures.Latency();
  std::vector<Image> charts = {OverTime(report, all), HowOften(all)};
  if (!report.server_over_time.empty()) {
    charts.push_back(ServerOverTime(report, "Memory of the server, MiB",
                                    &ServerSample::resident_bytes, 1 << 20));
    charts.push_back(ServerOverTime(report, "Files that it has open",
                                    &ServerSample::open_files, 1));
  }
  return Stacked(charts);
}

}  // namespace deform::cli
