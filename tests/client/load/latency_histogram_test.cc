#include "client/load/latency_histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace deform {
namespace {

using Duration = LatencyHistogram::Duration;

// From nanoseconds to minutes, as many of each order of magnitude.
std::vector<Duration> Durations(int seed, int count) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> exponent(0, 11);
  std::vector<Duration> values;
  for (int i = 0; i < count; ++i) {
    values.push_back(
        Duration(static_cast<int64_t>(std::pow(10, exponent(random)))));
  }
  return values;
}

LatencyHistogram HistogramOf(const std::vector<Duration>& values) {
  LatencyHistogram histogram;
  for (const Duration value : values) histogram.Add(value);
  return histogram;
}

TEST(LatencyHistogram, IsEmptyAtFirst) {
  const LatencyHistogram histogram;
  EXPECT_EQ(histogram.count(), 0);
  EXPECT_EQ(histogram.max(), Duration(0));
  EXPECT_EQ(histogram.Percentile(0.99), Duration(0));
}

TEST(LatencyHistogram, TellsPercentilesWithinItsBound) {
  std::vector<Duration> values = Durations(1, 5000);
  const LatencyHistogram histogram = HistogramOf(values);
  std::sort(values.begin(), values.end());
  for (const double part : {0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto k = static_cast<size_t>(std::ceil(part * 5000 - 1e-6));
    const auto exact = static_cast<double>(values[k - 1].count());
    const auto told = static_cast<double>(histogram.Percentile(part).count());
    EXPECT_GE(told, exact) << part;
    EXPECT_LE(told, exact * (1 + 1.0 / 128)) << part;
  }
}

TEST(LatencyHistogram, IsExactForOneValueOfAnySize) {
  for (const Duration value : Durations(2, 500)) {
    const LatencyHistogram histogram = HistogramOf({value});
    EXPECT_EQ(histogram.Percentile(0), value);
    EXPECT_EQ(histogram.Percentile(0.5), value);
    EXPECT_EQ(histogram.max(), value);
  }
}

TEST(LatencyHistogram, IsExactForSmallValues) {
  std::vector<Duration> values;
  for (int i = 0; i < 256; ++i) values.emplace_back(i);
  const LatencyHistogram histogram = HistogramOf(values);
  for (int i = 1; i <= 256; ++i) {
    EXPECT_EQ(histogram.Percentile(i / 256.0), Duration(i - 1));
  }
}

TEST(LatencyHistogram, PercentilesRise) {
  const LatencyHistogram histogram = HistogramOf(Durations(3, 300));
  Duration before(0);
  for (int i = 0; i <= 1000; ++i) {
    const Duration now = histogram.Percentile(i / 1000.0);
    EXPECT_GE(now, before);
    before = now;
  }
  EXPECT_EQ(before, histogram.max());
}

TEST(LatencyHistogram, MergedIsAsIfAllHadBeenAddedToOne) {
  const std::vector<Duration> some = Durations(4, 700), more = Durations(5, 90);
  std::vector<Duration> all = some;
  all.insert(all.end(), more.begin(), more.end());
  const LatencyHistogram one = HistogramOf(all);
  for (const bool swapped : {false, true}) {
    LatencyHistogram merged = HistogramOf(swapped ? more : some);
    merged.Merge(HistogramOf(swapped ? some : more));
    EXPECT_EQ(merged.count(), one.count());
    EXPECT_EQ(merged.max(), one.max());
    for (int i = 0; i <= 100; ++i) {
      EXPECT_EQ(merged.Percentile(i / 100.0), one.Percentile(i / 100.0));
    }
  }
}

TEST(LatencyHistogram, CountsWhatIsLonger) {
  const LatencyHistogram histogram =
      HistogramOf({Duration(10), Duration(100), std::chrono::milliseconds(2)});
  EXPECT_EQ(histogram.CountAbove(Duration(9)), 3);
  EXPECT_EQ(histogram.CountAbove(Duration(10)), 2);
  EXPECT_EQ(histogram.CountAbove(std::chrono::milliseconds(1)), 1);
  EXPECT_EQ(histogram.CountAbove(std::chrono::seconds(1)), 0);
}

TEST(LatencyHistogram, ClampsWhatIsBeyondItsEnds) {
  const LatencyHistogram histogram =
      HistogramOf({Duration(-5), std::chrono::hours(100)});
  EXPECT_EQ(histogram.Percentile(0.5), Duration(0));
  EXPECT_EQ(histogram.max(), LatencyHistogram::kLongest);
}

}  // namespace
}  // namespace deform
