// The store of a server by itself: a catalogue and pose journal in SQLite, and
// a file for the arrays of each model and each binding's weights.
//
//   <directory>/lock             who uses it (directory_lock.h)
//   <directory>/catalogue.sqlite tables (store_schema.cc)
//   <directory>/models, weights  arrays (array_shelf.h)
//   <directory>/quarantine       damaged files
//
// A file is complete and durable before the row that refers to it, and goes
// after it: a crash leaves files without rows, never rows without files.
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "core/base/error.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "server/stores/array_shelf.h"
#include "server/stores/backup.h"
#include "server/stores/directory_lock.h"
#include "server/stores/files.h"
#include "server/stores/pose_journal.h"
#include "server/stores/store.h"
#include "server/stores/store_database.h"
#include "server/stores/store_errors.h"

namespace deform::server {
namespace {

class SqliteStore : public Store {
 public:
  SqliteStore(const StoreOptions& options, DirectoryLock lock,
              std::unique_ptr<StoreDatabase> database)
      : options_(options),
        lock_(std::move(lock)),
        shelf_(*options.files, options.directory),
        database_(std::move(database)),
        journal_(options.max_waiting_bytes,
                 [this](auto& entries) { return Commit(entries); }) {}

  absl::Status Start() {
    DEFORM_RETURN_IF_ERROR(shelf_.Prepare());
    // Of a server that a full disk has stopped.
    Locked([](StoreDatabase& rows) { return rows.FoldLog(); }).IgnoreError();
    DEFORM_ASSIGN_OR_RETURN(const auto heads, Locked([](StoreDatabase& rows) {
                              return rows.LoadHeads();
                            }));
    for (const auto& [key, head] : heads) journal_.Add(key, head);
    // Files that cannot be removed do no harm.
    CollectOrphans().IgnoreError();
    return absl::OkStatus();
  }

  bool survives_restart() const override { return true; }

  absl::StatusOr<StoreContents> Load() override {
    return Locked([](StoreDatabase& rows) { return rows.Load(); });
  }

  absl::Status PutModel(const StoredModel& model,
                        const StoredArrays& arrays) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(model.key));
    const auto write = [&](const ArrayShelf::Claim& claim) -> absl::Status {
      DEFORM_ASSIGN_OR_RETURN(const bool there, shelf_.Has(claim));
      return there ? absl::OkStatus() : shelf_.Write(claim, arrays);
    };
    return PutFile(ModelFile(model.key), write,
                   [&](StoreDatabase& rows) { return rows.PutModel(model); });
  }

  absl::StatusOr<StoredArrays> ModelArrays(const StoreKey& model) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(model));
    const ArrayShelf::Claim claim = shelf_.Take(ModelFile(model));
    DEFORM_ASSIGN_OR_RETURN(const bool has, Locked([&](StoreDatabase& rows) {
                              return rows.HasModel(model);
                            }));
    if (!has) return NotStored("model", model);
    absl::StatusOr<StoredArrays> arrays = shelf_.Read(claim);
    if (!absl::IsNotFound(arrays.status())) return arrays;
    return FileDamaged(claim.name(), "it is gone");
  }

  absl::Status DeleteModel(const StoreKey& model) override {
    return Delete(model,
                  [&](StoreDatabase& rows) { return rows.DeleteModel(model); });
  }

  absl::Status PutBinding(const StoredBinding& binding) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding.key));
    return Locked(
        [&](StoreDatabase& rows) { return rows.PutBinding(binding); });
  }

  absl::Status PutWeights(const StoreKey& binding, const WeightsForm& form,
                          const StoredArrays& arrays) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding));
    DEFORM_RETURN_IF_ERROR(CheckForm(form));
    DEFORM_RETURN_IF_ERROR(FormOf(binding).status());
    std::optional<WeightsForm> before;
    const auto write = [&](const ArrayShelf::Claim& claim) {
      return shelf_.Write(claim, arrays);
    };
    const auto put_row = [&](StoreDatabase& rows) -> absl::Status {
      DEFORM_ASSIGN_OR_RETURN(before, rows.SetWeights(binding, form));
      return absl::OkStatus();
    };
    DEFORM_RETURN_IF_ERROR(PutFile(WeightsFile(binding, form), write, put_row));
    if (before && *before != form) Discard(WeightsFile(binding, *before));
    return absl::OkStatus();
  }

  absl::StatusOr<StoredWeights> Weights(const StoreKey& binding) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding));
    while (true) {
      DEFORM_ASSIGN_OR_RETURN(const auto form, FormOf(binding));
      if (!form) return WeightsNotStored(binding);
      const ArrayShelf::Claim claim = shelf_.Take(WeightsFile(binding, *form));
      DEFORM_ASSIGN_OR_RETURN(const auto still, FormOf(binding));
      if (still != form) continue;  // Replaced before they were claimed.
      absl::StatusOr<StoredArrays> arrays = shelf_.Read(claim);
      if (arrays.ok()) return StoredWeights{*form, *std::move(arrays)};
      if (absl::IsNotFound(arrays.status())) return WeightsNotStored(binding);
      return arrays.status();
    }
  }

  absl::Status DeleteBinding(const StoreKey& binding) override {
    return Delete(binding, [&](StoreDatabase& rows) {
      return rows.DeleteBinding(binding);
    });
  }

  absl::Status PutSession(const StoredSession& session) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(session.key));
    DEFORM_RETURN_IF_ERROR(CheckEpoch(session.epoch));
    return Locked([&](StoreDatabase& rows) -> absl::Status {
      DEFORM_ASSIGN_OR_RETURN(const int64_t number, rows.PutSession(session));
      journal_.Add(session.key, {.session = number, .epoch = session.epoch});
      return absl::OkStatus();
    });
  }

  absl::StatusOr<SessionPose> LoadSession(const StoreKey& session) override {
    return Locked([&](StoreDatabase& rows) { return rows.LoadPose(session); });
  }

  absl::StatusOr<std::vector<uint64_t>> TakeOver(
      std::span<const StoreKey> sessions) override {
    using Epochs = std::vector<uint64_t>;
    return Locked([&](StoreDatabase& rows) -> absl::StatusOr<Epochs> {
      DEFORM_ASSIGN_OR_RETURN(Epochs epochs, rows.RaiseEpochs(sessions));
      for (size_t i = 0; i < sessions.size(); ++i) {
        journal_.TakeOver(sessions[i], epochs[i]);
      }
      return epochs;
    });
  }

  absl::Status DeleteSession(const StoreKey& session) override {
    return Locked([&](StoreDatabase& rows) -> absl::Status {
      DEFORM_RETURN_IF_ERROR(rows.DeleteSession(session));
      journal_.Remove(session);
      return absl::OkStatus();
    });
  }

  absl::Status Append(PoseAppend append, Done done) override {
    return journal_.Append(std::move(append), std::move(done));
  }
  uint64_t DurableRevision(const StoreKey& session) override {
    return journal_.DurableRevision(session);
  }
  absl::Status Sync() override { return journal_.Sync(); }

  absl::StatusOr<int64_t> CollectOrphans() override {
    return shelf_.CollectOrphans(
        [this](const std::string& file) { return RefersTo(file); });
  }

  absl::Status Backup(const std::string& directory) override {
    BackupWriter backup(*options_.files, options_.directory, directory);
    DEFORM_RETURN_IF_ERROR(backup.Begin());
    const ArrayShelf::Hold hold(shelf_);
    const auto copy =
        [&](StoreDatabase& rows) -> absl::StatusOr<std::vector<std::string>> {
      DEFORM_RETURN_IF_ERROR(
          rows.CopyTo(backup.catalogue(), options_.sqlite_vfs));
      return rows.Files();
    };
    DEFORM_ASSIGN_OR_RETURN(const auto files, Locked(copy));
    return backup.Finish(files);
  }

 private:
  template <typename Body>
  std::invoke_result_t<Body, StoreDatabase&> Locked(Body body) {
    MutexLock lock(mutex_);
    auto result = body(*database_);
    if (DetailOf(StatusOf(result)).reason == "DISK_FULL") {
      database_->FoldLog().IgnoreError();
    }
    return result;
  }
  static const absl::Status& StatusOf(const absl::Status& status) {
    return status;
  }
  template <typename Value>
  static const absl::Status& StatusOf(const absl::StatusOr<Value>& value) {
    return value.status();
  }

  // The file, then the row that refers to it.
  template <typename Write, typename PutRow>
  absl::Status PutFile(const std::string& file, Write write, PutRow put_row) {
    absl::Status status;
    {
      const ArrayShelf::Claim claim = shelf_.Take(file);
      status = write(claim);
      if (status.ok()) status = Locked(put_row);
    }
    if (!status.ok()) Discard(file);
    return status;
  }

  // The rows, then the files that they referred to.
  template <typename DeleteRows>
  absl::Status Delete(const StoreKey& key, DeleteRows delete_rows) {
    DEFORM_RETURN_IF_ERROR(CheckKey(key));
    const auto remove =
        [&](StoreDatabase& rows) -> absl::StatusOr<std::vector<std::string>> {
      DEFORM_ASSIGN_OR_RETURN(auto deleted, delete_rows(rows));
      for (const StoreKey& session : deleted.sessions) journal_.Remove(session);
      return std::move(deleted.files);
    };
    DEFORM_ASSIGN_OR_RETURN(const auto files, Locked(remove));
    for (const std::string& file : files) Discard(file);
    return absl::OkStatus();
  }

  // Unless it is needed. What cannot be removed now is an orphan.
  void Discard(const std::string& file) {
    shelf_
        .RemoveOrphan(
            file, [this](const std::string& name) { return RefersTo(name); })
        .IgnoreError();
  }

  absl::StatusOr<bool> RefersTo(const std::string& file) {
    return Locked([&](StoreDatabase& rows) { return rows.RefersTo(file); });
  }
  absl::StatusOr<std::optional<WeightsForm>> FormOf(const StoreKey& binding) {
    return Locked([&](StoreDatabase& rows) { return rows.WeightsOf(binding); });
  }

  absl::Status Commit(std::vector<PoseJournal::Entry>& entries) {
    return Locked([&](StoreDatabase& rows) {
      return rows.Atomically([&]() -> absl::Status {
        for (PoseJournal::Entry& entry : entries) {
          DEFORM_RETURN_IF_ERROR(rows.Append(entry.session, entry.after,
                                             entry.append, entry.status));
        }
        return absl::OkStatus();
      });
    });
  }

  const StoreOptions options_;
  const DirectoryLock lock_;
  ArrayShelf shelf_;
  Mutex mutex_;
  const std::unique_ptr<StoreDatabase> database_ ABSL_PT_GUARDED_BY(mutex_);
  PoseJournal journal_;  // Goes first: it commits what waits.
};

class Sqlite : public StoreKind {
 public:
  absl::string_view id() const override { return "sqlite"; }

  absl::StatusOr<std::unique_ptr<Store>> Open(
      const StoreOptions& options) const override {
    FileSystem& files = *options.files;
    DEFORM_RETURN_IF_ERROR(MakeDirectory(files, options.directory));
    DEFORM_ASSIGN_OR_RETURN(auto lock,
                            DirectoryLock::Take(files, options.directory));
    DEFORM_ASSIGN_OR_RETURN(
        auto database, StoreDatabase::Open(CatalogueFile(options.directory),
                                           options.sqlite_vfs));
    // SQLite syncs the file, but not its name.
    DEFORM_RETURN_IF_ERROR(SyncFolder(files, options.directory));
    auto store = std::make_unique<SqliteStore>(options, std::move(lock),
                                               std::move(database));
    DEFORM_RETURN_IF_ERROR(store->Start());
    return store;
  }
};

}  // namespace

const StoreKind& SqliteStoreKind() {
  static const Sqlite kind;
  return kind;
}

}  // namespace deform::server
