// How the rig of a session has changed, for poses that are meant for an older
// one.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "server/sessions/rig_change.h"

namespace deform::server {

// Not thread-safe.
class RigHistory {
 public:
  // Changes over which poses are taken.
  static constexpr size_t kMaxChanges = 16;

  void Add(std::shared_ptr<const RigChange> change);
  // All changes there were.
  uint64_t count() const { return count_; }
  // The last `number` of them, oldest first; none if not so many are known.
  std::optional<std::vector<std::shared_ptr<const RigChange>>> Last(
      uint64_t number) const;

  // `update` as it is for the present rig; it was made for the rig as it was
  // `changes` changes ago, of at most count(). InvalidArgument RIG_CHANGED (too
  // often), what CheckPoseUpdate() finds, and what PoseTransfer refuses.
  absl::StatusOr<PoseUpdate> TakeOver(PoseUpdate update,
                                      uint64_t changes) const;

 private:
  std::deque<std::shared_ptr<const RigChange>> changes_;  // The last of them.
  uint64_t count_ = 0;
};

}  // namespace deform::server
