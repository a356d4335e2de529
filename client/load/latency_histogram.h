// A histogram of durations over many orders of magnitude, in bounded memory.
#pragma once

#include <chrono>
#include <cstdint>
#include <vector>

namespace deform {

// Log-linear, as Gil Tene's HdrHistogram is: every octave is cut into 128
// buckets of equal width, so that a percentile is never told as less than it
// is, and as at most 1/128 (0.8 %) more. Durations below 256 ns and the largest
// of all are exact. At most 35 kB. Not thread-safe.
class LatencyHistogram {
 public:
  using Duration = std::chrono::nanoseconds;
  // Longer ones count as this (18 minutes), negative ones as 0.
  static constexpr Duration kLongest{(int64_t{1} << 40) - 1};

  void Add(Duration value);
  // As if all of `other` had been added.
  void Merge(const LatencyHistogram& other);

  int64_t count() const { return count_; }
  Duration max() const { return max_; }  // 0 if empty.

  // The least duration that `part`, from 0 to 1, of all do not exceed; 0 if
  // empty.
  Duration Percentile(double part) const;
  // How many are longer than `value`, to the width of its bucket.
  int64_t CountAbove(Duration value) const;

 private:
  std::vector<int64_t> counts_;  // By bucket, up to the last in use.
  int64_t count_ = 0;
  Duration max_{0};
};

inline double Milliseconds(LatencyHistogram::Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

}  // namespace deform
