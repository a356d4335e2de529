#include "client/load/recorder.h"

namespace deform {

LatencyHistogram LoadFigures::Latency() const {
  LatencyHistogram all;
  for (const Interval& interval : intervals) all.Merge(interval.latency);
  return all;
}

LoadRecorder::LoadRecorder(TimePoint begin, TimePoint end,
                           std::chrono::nanoseconds interval)
    : begin_(begin), end_(end), interval_(interval) {
  for (auto at = begin; at < end; at += interval) {
    figures_.intervals.push_back(
        {.begin = std::chrono::duration<double>(at - begin).count()});
  }
}

void LoadRecorder::Sent(TimePoint due, std::chrono::nanoseconds lateness,
                        bool held_back) {
  if (!Within(due)) return;
  MutexLock lock(mutex_);
  figures_.lateness.Add(lateness);
  if (held_back) ++figures_.held_back;
}

void LoadRecorder::Answered(TimePoint due, TimePoint arrived) {
  if (!Within(due)) return;
  MutexLock lock(mutex_);
  figures_.intervals[(due - begin_) / interval_].latency.Add(arrived - due);
}

void LoadRecorder::Arrived(TimePoint now, int64_t bytes, uint64_t skipped,
                           bool answering, int64_t deform_us) {
  if (!Within(now)) return;
  MutexLock lock(mutex_);
  ++figures_.frames;
  figures_.bytes += bytes;
  figures_.skipped += static_cast<int64_t>(skipped);
  if (!answering) return;
  ++figures_.answering;
  figures_.deform_us += deform_us;
}

LoadFigures LoadRecorder::figures() const {
  MutexLock lock(mutex_);
  return figures_;
}

}  // namespace deform
