#include "server/sessions/rig_history.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {

void RigHistory::Add(std::shared_ptr<const RigChange> change) {
  changes_.push_back(std::move(change));
  ++count_;
  if (changes_.size() > kMaxChanges) changes_.pop_front();
}

std::optional<std::vector<std::shared_ptr<const RigChange>>> RigHistory::Last(
    uint64_t number) const {
  if (number > changes_.size()) return std::nullopt;
  return std::vector<std::shared_ptr<const RigChange>>(
      changes_.end() - static_cast<int64_t>(number), changes_.end());
}

absl::StatusOr<PoseUpdate> RigHistory::TakeOver(PoseUpdate update,
                                                uint64_t changes) const {
  if (changes > changes_.size()) {
    return InvalidInput(
        "RIG_CHANGED", "pose.rig_changes",
        absl::StrCat("the rig has changed ", changes,
                     " times since the one that this pose is for: read "
                     "rig_changed"));
  }
  for (auto change = changes_.end() - static_cast<int64_t>(changes);
       change != changes_.end(); ++change) {
    const PoseTransfer& transfer = (*change)->transfer;
    const absl::Status status = CheckPoseUpdate(update, transfer.from());
    if (!status.ok()) {
      return Annotate(status,
                      absl::StrCat("the rig has changed, and this pose is not "
                                   "for the new one (rig_changes): "));
    }
    DEFORM_ASSIGN_OR_RETURN(update, transfer.Transfer(update));
  }
  return update;
}

}  // namespace deform::server
