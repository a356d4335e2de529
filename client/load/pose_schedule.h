// When poses are due: fixed beforehand, whatever the server does.
#pragma once

#include <chrono>
#include <cstdint>

#include "absl/functional/function_ref.h"

namespace deform {

// Editor e of E sends `poses_each` poses, numbered from 1, one a period. The
// editors' phases are spread evenly over it, so that all poses together are due
// at equal distances, in the order of their numbers, editors in turn.
// Immutable.
class PoseSchedule {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  PoseSchedule(TimePoint start, std::chrono::nanoseconds period,
               int64_t editors, int64_t poses_each)
      : start_(start),
        period_(period),
        editors_(editors),
        poses_each_(poses_each) {}

  struct Due {
    TimePoint time;
    int64_t editor = 0;
    uint64_t sequence = 0;
  };
  // The i-th of all, in time.
  Due At(int64_t i) const;
  int64_t size() const { return editors_ * poses_each_; }

  TimePoint TimeOf(int64_t editor, uint64_t sequence) const;
  TimePoint start() const { return start_; }
  // A period after the last of each was due.
  TimePoint end() const { return start_ + poses_each_ * period_; }

 private:
  TimePoint start_;
  std::chrono::nanoseconds period_;
  int64_t editors_;
  int64_t poses_each_;
};

// Time as Pace() sees it; tests pass their own.
struct PaceClock {
  absl::FunctionRef<PoseSchedule::TimePoint()> now;
  // Returns at `time`, or before. False: give up.
  absl::FunctionRef<bool(PoseSchedule::TimePoint)> sleep_until;
};

// Calls send(due, lateness) for every `step`-th pose from `first` on, never
// before it is due. Who comes late, because a call or the machine held it up,
// does not drop or move what follows: those that are overdue come at once, each
// with the lateness it has. Ends early when send() returns false.
void Pace(
    const PoseSchedule& schedule, int64_t first, int64_t step,
    const PaceClock& clock,
    absl::FunctionRef<bool(const PoseSchedule::Due&, std::chrono::nanoseconds)>
        send);

}  // namespace deform
