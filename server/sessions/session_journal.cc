#include "server/sessions/session_journal.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform::server {
namespace {

std::vector<int32_t> MovedRows(const Pose& before, const Pose& now) {
  std::vector<int32_t> moved;
  for (int32_t row = 0; row < now.vertices.rows(); ++row) {
    if (before.vertices.row(row) != now.vertices.row(row)) moved.push_back(row);
  }
  return moved;
}

// A change of so many rows is written as a whole pose.
bool IsMost(size_t moved, const Pose& pose) {
  return 2 * static_cast<int64_t>(moved) > pose.vertices.rows();
}

bool IsLost(const absl::Status& status) {
  const std::string reason = DetailOf(status).reason;
  return reason == "SESSION_NOT_FOUND" || reason == "STALE_EPOCH";
}

}  // namespace

SessionJournal::SessionJournal(Store* store, StoreKey session, uint64_t epoch,
                               uint64_t revision, JournalReport report)
    : store_(store), epoch_(epoch), progress_(std::make_shared<Progress>()) {
  progress_->counts = store != nullptr && store->survives_restart();
  if (progress_->counts) progress_->durable = revision;
  progress_->session = std::move(session);
  progress_->report = std::move(report);
}

void SessionJournal::Progress::Ended(uint64_t revision,
                                     const absl::Status& status) {
  if (status.ok()) {
    failing = false;
    // In their order, by one thread.
    if (counts) durable = revision;
    return;
  }
  needs_whole = true;
  // It was deleted; nobody misses the rest.
  if (DetailOf(status).reason == "SESSION_NOT_FOUND") return;
  if (failing.exchange(true) || !report) return;
  report(Annotate(status,
                  absl::StrCat("session ", session.id, " of tenant ",
                               session.tenant, " is not durable for now: ")));
}

absl::Status SessionJournal::Append(const Revision& revision) {
  if (store_ == nullptr) return absl::OkStatus();
  bool whole = progress_->needs_whole.exchange(false) || revision.rig_changed;
  const auto append = [&] {
    return store_->Append(
        Describe(revision, whole),
        [progress = progress_, number = revision.number](
            const absl::Status& status) { progress->Ended(number, status); });
  };
  absl::Status status = append();
  if (!whole && DetailOf(status).reason == "REVISION_GAP") {
    // The one before has failed meanwhile.
    whole = true;
    status = append();
  }
  if (status.ok()) return status;
  progress_->Ended(revision.number, status);
  return IsLost(status) ? status : absl::OkStatus();
}

PoseAppend SessionJournal::Describe(const Revision& revision,
                                    bool whole) const {
  PoseAppend append{.session = progress_->session,
                    .epoch = epoch_,
                    .revision = revision.number,
                    .whole = whole,
                    .stretch_blend = revision.now->stretch_blend,
                    .answers = revision.answers};
  const Positions& now = revision.now->vertices;
  if (!whole) {
    append.rows = MovedRows(*revision.before, *revision.now);
    append.whole = IsMost(append.rows.size(), *revision.now);
  }
  if (append.whole) {
    append.rows.clear();
    append.positions = now;
    // Always: the first of the rig may not have become durable.
    append.binding_id = revision.binding_id;
    return append;
  }
  append.positions.resize(static_cast<int64_t>(append.rows.size()), 3);
  for (size_t i = 0; i < append.rows.size(); ++i) {
    append.positions.row(static_cast<int64_t>(i)) = now.row(append.rows[i]);
  }
  return append;
}

}  // namespace deform::server
