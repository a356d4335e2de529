// What a load run counts.
#pragma once

#include <chrono>
#include <cstdint>
#include <vector>

#include "client/load/latency_histogram.h"
#include "core/base/mutex.h"

namespace deform {

// Figures of the measured window.
struct LoadFigures {
  // Pose due to the arrival of the frame that answers it, by when the pose was
  // due: a stall shows in all poses that were due during it.
  struct Interval {
    double begin = 0;  // Seconds since the window's begin.
    LatencyHistogram latency;
  };
  std::vector<Interval> intervals;
  // How late this program was itself in sending a pose. Held back: sent later
  // than that, because the one before was still under way to the server.
  LatencyHistogram lateness;
  int64_t held_back = 0;
  // That arrived at any participant within the window.
  int64_t frames = 0;
  int64_t bytes = 0;
  int64_t skipped = 0;
  // Frames that answered poses, and the time that the server took to deform
  // for them.
  int64_t answering = 0;
  int64_t deform_us = 0;

  LatencyHistogram Latency() const;  // Of all intervals.
};

// Thread-safe.
class LoadRecorder {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  // Counts poses that are due, and frames that arrive, in [begin, end).
  LoadRecorder(TimePoint begin, TimePoint end,
               std::chrono::nanoseconds interval);

  void Sent(TimePoint due, std::chrono::nanoseconds lateness, bool held_back);
  void Answered(TimePoint due, TimePoint arrived);
  void Arrived(TimePoint now, int64_t bytes, uint64_t skipped, bool answering,
               int64_t deform_us);

  LoadFigures figures() const;

 private:
  bool Within(TimePoint time) const { return time >= begin_ && time < end_; }

  const TimePoint begin_, end_;
  const std::chrono::nanoseconds interval_;
  mutable Mutex mutex_;
  LoadFigures figures_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform
