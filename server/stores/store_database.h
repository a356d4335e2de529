// The tables of a store: all of its SQL.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/stores/poses.h"
#include "server/stores/records.h"
#include "server/stores/sqlite.h"

namespace deform::server {

// What brings a database from one version of the format to the next: the first
// makes version 1 of an empty one.
std::span<const char* const> StoreUpgrades();

// One thread at a time. Each call is a transaction of its own, unless it says
// otherwise.
class StoreDatabase {
 public:
  // Checks the structure and brings an older version up to this one, whole or
  // not at all. FailedPrecondition NOT_A_STORE, FORMAT_TOO_NEW; DataLoss
  // CATALOGUE_DAMAGED. `upgrades` is a parameter for tests.
  static absl::StatusOr<std::unique_ptr<StoreDatabase>> Open(
      const std::string& path, const char* vfs,
      std::span<const char* const> upgrades = StoreUpgrades());

  absl::StatusOr<StoreContents> Load();
  // Every session, also those whose poses are damaged.
  struct NumberedHead {
    StoreKey key;
    PoseHead head;
  };
  absl::StatusOr<std::vector<NumberedHead>> LoadHeads();

  absl::Status PutModel(const StoredModel& model);
  absl::StatusOr<bool> HasModel(const StoreKey& key);
  // What goes with a row.
  struct Deleted {
    std::vector<std::string> files;  // Of arrays, by name.
    std::vector<StoreKey> sessions;
  };
  absl::StatusOr<Deleted> DeleteModel(const StoreKey& key);

  absl::Status PutBinding(const StoredBinding& binding);
  // Returns the form before, if any.
  absl::StatusOr<std::optional<WeightsForm>> SetWeights(
      const StoreKey& binding, const WeightsForm& form);
  absl::StatusOr<std::optional<WeightsForm>> WeightsOf(const StoreKey& binding);
  absl::StatusOr<Deleted> DeleteBinding(const StoreKey& key);

  // Returns its number.
  absl::StatusOr<int64_t> PutSession(const StoredSession& session);
  absl::Status DeleteSession(const StoreKey& key);
  // In one commit; those of `keys`, in their order.
  absl::StatusOr<std::vector<uint64_t>> RaiseEpochs(
      std::span<const StoreKey> keys);
  absl::StatusOr<SessionPose> LoadPose(const StoreKey& key);

  // For PoseJournal::Commit, within Atomically(). `refused` is about this one
  // alone, and nothing of it was written: NotFound SESSION_NOT_FOUND,
  // BINDING_NOT_FOUND; FailedPrecondition STALE_EPOCH, STALE_REVISION,
  // REVISION_GAP; DataLoss ENTRY_DAMAGED.
  absl::Status Append(int64_t session, uint64_t after, const PoseAppend& append,
                      absl::Status& refused);
  template <typename Body>
  absl::Status Atomically(Body body) {
    return database_->Atomically(body);
  }

  // Of arrays, by name.
  absl::StatusOr<bool> RefersTo(const std::string& file);
  absl::StatusOr<std::vector<std::string>> Files();

  absl::Status CopyTo(const std::string& path, const char* vfs) {
    return database_->CopyTo(path, vfs);
  }
  // Folds the log into the file, so that its room is free again. Else a disk
  // that the log has filled would take no commit for ever, not even one that
  // removes something.
  absl::Status FoldLog() {
    return database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)");
  }

 private:
  struct SessionRow {
    int64_t number = 0;
    StoredSession session;
  };

  explicit StoreDatabase(std::unique_ptr<Database> database)
      : database_(std::move(database)) {}

  // Those that `sql` finds for `key`.
  absl::Status AddKeys(const char* sql, const StoreKey& key,
                       std::vector<StoreKey>& found);
  // Removes a binding, or finds that there is none.
  absl::Status DeleteBindingInto(const StoreKey& key, Deleted& deleted);
  absl::Status Prepare(std::span<const char* const> upgrades);
  absl::StatusOr<SessionRow> FindSession(const StoreKey& key);
  absl::Status WriteSession(int64_t number, const StoredSession& session);
  absl::StatusOr<SessionPose> ReadPoses(const SessionRow& row);
  absl::StatusOr<SessionRow> FindSession(int64_t number);
  absl::StatusOr<uint64_t> LastRevision(int64_t session);
  absl::StatusOr<bool> HasBinding(const StoreKey& key);
  absl::Status WritePose(int64_t session, const PoseAppend& append);
  absl::StatusOr<bool> NeedsCompaction(int64_t session);

  const std::unique_ptr<Database> database_;
};

}  // namespace deform::server
