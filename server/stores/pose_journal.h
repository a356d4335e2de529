// Poses on their way to the disk: checked when they come, committed together.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "core/base/mutex.h"
#include "server/stores/poses.h"
#include "server/stores/records.h"
#include "server/stores/store.h"

namespace deform::server {

// Thread-safe. A thread of its own commits all that waits, then what has come
// meanwhile: the slower the disk, the larger the groups. What a session
// appended since the last commit is folded into one append.
class PoseJournal {
 public:
  struct Entry {
    int64_t session = 0;  // PoseHead::session.
    uint64_t after = 0;   // The revision that it follows.
    PoseAppend append;
    absl::Status status;  // Of this entry alone; set by the commit.
  };
  // Makes the entries durable, or none and returns why. An entry that may no
  // longer be written gets a status and is left out.
  using Commit = std::function<absl::Status(std::vector<Entry>&)>;

  PoseJournal(int64_t max_waiting_bytes, Commit commit);
  // Commits what waits.
  ~PoseJournal();

  // Sessions come and go, and change hands.
  void Add(const StoreKey& session, const PoseHead& head);
  void Remove(const StoreKey& session);
  void TakeOver(const StoreKey& session, uint64_t epoch);

  // As in Store.
  absl::Status Append(PoseAppend append, Store::Done done);
  uint64_t DurableRevision(const StoreKey& session);
  absl::Status Sync();

 private:
  struct Item {
    int64_t session = 0;  // 0: a barrier, nothing to be written.
    uint64_t after = 0;   // The revision accepted before.
    PoseAppend append;
    int64_t bytes = 0;
    Store::Done done;
    size_t entry = 0;  // That it was folded into.
  };
  using Batch = std::vector<Item>;

  void Run();
  static std::vector<Entry> FoldAll(Batch& batch);
  // What fails with the batch is put behind it.
  void Settle(const std::vector<Entry>& entries, const absl::Status& status,
              Batch& batch);
  void Tell(const Batch& batch, const std::vector<Entry>& entries,
            const absl::Status& status);
  void FailWhatWaits(Batch& batch) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const int64_t max_waiting_bytes_;
  const Commit commit_;
  absl::Status failure_;  // Since the last barrier; of the thread alone.
  Mutex mutex_;
  CondVar changed_;
  std::map<StoreKey, PoseHead> heads_ ABSL_GUARDED_BY(mutex_);
  Batch queue_ ABSL_GUARDED_BY(mutex_);
  int64_t waiting_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace deform::server
