// Poses that a session has accepted and not yet deformed with.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "core/deform/pose.h"
#include "core/deform/pose_transfer.h"

namespace deform::server {

// Poses of interactive participants merge into one step: they want the present,
// not the backlog. Those of participants that asked for every revision stay
// apart. The order of arrival holds between both: the last writer of a vertex
// wins. Not thread-safe.
class PoseQueue {
 public:
  // Whose poses a step contains, and up to which.
  struct Answer {
    int64_t participant = 0;
    uint64_t sequence = 0;
    uint64_t write = 0;  // Its number in the WriteLog.
  };
  struct Step {
    Pose pose;                    // Where the rig is after this step.
    std::vector<Answer> answers;  // One per participant.
    bool own_revision = false;    // Nothing may merge into it.
  };

  explicit PoseQueue(Pose rest) : pose_(std::move(rest)) {}

  // `update` is right (CheckPoseUpdate). O(V) for the first pose of a step,
  // O(rows of the update) for those that merge.
  void Push(const Answer& answer, const PoseUpdate& update, bool own_revision);

  // The oldest step.
  std::optional<Step> Pop();

  // The rig has changed: what waits goes on with the new one.
  void Transfer(const PoseTransfer& transfer);

  // Where the rig will be after all steps.
  const Pose& newest() const {
    return steps_.empty() ? pose_ : steps_.back().pose;
  }

  void Clear() { steps_.clear(); }
  bool empty() const { return steps_.empty(); }
  // Steps of `participant`'s own that wait.
  int64_t OwnStepsOf(int64_t participant) const;

 private:
  Pose pose_;  // Where the rig is after all steps that were popped.
  std::deque<Step> steps_;
};

}  // namespace deform::server
