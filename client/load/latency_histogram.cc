#include "client/load/latency_histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace deform {
namespace {

constexpr int kBits = 7;
constexpr size_t kPerOctave = size_t{1} << kBits;

// Values below 2 kPerOctave have a bucket each; above, the first kBits + 1
// digits of a value choose it.
size_t BucketOf(int64_t value) {
  const int shift = std::max(
      0, static_cast<int>(std::bit_width(static_cast<uint64_t>(value))) -
             (kBits + 1));
  return shift * kPerOctave + static_cast<size_t>(value >> shift);
}

// The largest value of a bucket.
int64_t EndOf(size_t bucket) {
  if (bucket < 2 * kPerOctave) return static_cast<int64_t>(bucket);
  const size_t shift = bucket / kPerOctave - 1;
  const size_t digits = bucket - shift * kPerOctave;
  return static_cast<int64_t>(((digits + 1) << shift) - 1);
}

int64_t Clamped(LatencyHistogram::Duration value) {
  return std::clamp(value, LatencyHistogram::Duration(0),
                    LatencyHistogram::kLongest)
      .count();
}

}  // namespace

void LatencyHistogram::Add(Duration value) {
  const int64_t clamped = Clamped(value);
  const size_t bucket = BucketOf(clamped);
  if (bucket >= counts_.size()) counts_.resize(bucket + 1);
  ++counts_[bucket];
  ++count_;
  max_ = std::max(max_, Duration(clamped));
}

void LatencyHistogram::Merge(const LatencyHistogram& other) {
  if (other.counts_.size() > counts_.size()) {
    counts_.resize(other.counts_.size());
  }
  for (size_t b = 0; b < other.counts_.size(); ++b) {
    counts_[b] += other.counts_[b];
  }
  count_ += other.count_;
  max_ = std::max(max_, other.max_);
}

LatencyHistogram::Duration LatencyHistogram::Percentile(double part) const {
  // Of n durations the k-th, k = ceil(part n): rounding is not to make it k+1.
  const double exact = part * static_cast<double>(count_);
  const auto wanted = static_cast<int64_t>(std::ceil(exact - 1e-9 * exact));
  int64_t so_far = 0;
  for (size_t b = 0; b < counts_.size(); ++b) {
    so_far += counts_[b];
    if (counts_[b] > 0 && so_far >= wanted) {
      return std::min(Duration(EndOf(b)), max_);
    }
  }
  return max_;
}

int64_t LatencyHistogram::CountAbove(Duration value) const {
  int64_t above = 0;
  for (size_t b = BucketOf(Clamped(value)) + 1; b < counts_.size(); ++b) {
    above += counts_[b];
  }
  return above;
}

}  // namespace deform
