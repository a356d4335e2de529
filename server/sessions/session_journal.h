// A session's way into the store: which part of each revision is written, and
// how far that has come.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "core/deform/pose.h"
#include "server/stores/store.h"

namespace deform::server {

// Told that a session is not durable for the time being, and why; on any
// thread, perhaps with locks held: it only writes a line.
using JournalReport = std::function<void(const absl::Status&)>;

// Not thread-safe, but for what says otherwise.
class SessionJournal {
 public:
  // The session is in the store, at `revision`. The store is borrowed; null:
  // nothing is kept.
  SessionJournal(Store* store, StoreKey session, uint64_t epoch,
                 uint64_t revision, JournalReport report);

  uint64_t epoch() const { return epoch_; }

  struct Revision {
    uint64_t number = 0;  // One more than that of the last.
    const Pose* before = nullptr;
    const Pose* now = nullptr;
    std::string binding_id;    // That the pose is of,
    bool rig_changed = false;  // for the first time.
    // Of all who take part.
    AnsweredSequences answers;
  };
  // Hands a revision to the store and does not wait for it: only the rows that
  // moved, where that is less and the store has the revision before. What the
  // store cannot take now is not durable until a later revision is; the session
  // goes on. FailedPrecondition STALE_EPOCH, NotFound SESSION_NOT_FOUND: the
  // session is no longer this server's, and ends.
  absl::Status Append(const Revision& revision);

  // Up to which revision everything is there after a restart, 0 if nothing is.
  // Thread-safe, and takes no lock.
  uint64_t durable_revision() const { return progress_->durable; }

 private:
  // Shared with those who wait for the disk: they may outlive the session.
  struct Progress {
    std::atomic<uint64_t> durable = 0;
    std::atomic<bool> needs_whole = true;
    std::atomic<bool> failing = false;
    bool counts = false;  // The store survives a restart.
    StoreKey session;
    JournalReport report;

    void Ended(uint64_t revision, const absl::Status& status);
  };

  PoseAppend Describe(const Revision& revision, bool whole) const;

  Store* const store_;
  const uint64_t epoch_;
  const std::shared_ptr<Progress> progress_;
};

}  // namespace deform::server
