#include "client/load/pose_schedule.h"

namespace deform {

PoseSchedule::Due PoseSchedule::At(int64_t i) const {
  const int64_t editor = i % editors_;
  const auto sequence = static_cast<uint64_t>(i / editors_ + 1);
  return {TimeOf(editor, sequence), editor, sequence};
}

PoseSchedule::TimePoint PoseSchedule::TimeOf(int64_t editor,
                                             uint64_t sequence) const {
  return start_ + static_cast<int64_t>(sequence - 1) * period_ +
         editor * period_ / editors_;
}

void Pace(
    const PoseSchedule& schedule, int64_t first, int64_t step,
    const PaceClock& clock,
    absl::FunctionRef<bool(const PoseSchedule::Due&, std::chrono::nanoseconds)>
        send) {
  for (int64_t i = first; i < schedule.size(); i += step) {
    const PoseSchedule::Due due = schedule.At(i);
    auto now = clock.now();
    while (now < due.time) {
      if (!clock.sleep_until(due.time)) return;
      now = clock.now();
    }
    if (!send(due, now - due.time)) return;
  }
}

}  // namespace deform
