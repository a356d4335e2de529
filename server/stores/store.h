// The seam for stores: what outlives a server.
//
// To add a store: write kinds/<name>.cc, then add one line to
// builtin_stores.cc. The contract tests run over that list.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "server/stores/file_system.h"
#include "server/stores/records.h"

namespace deform::server {

// Thread-safe. Every call is atomic, and there for all later ones.
//
// Durability. A call that returns OK, and an append whose `done` was told OK,
// is there after the end of the process at any instant and, with a store on
// disk, after a loss of power too. What ended in an error may be there after a
// restart or not, but never in part; for the running server it is not there.
//
// Order. Appends of a session become durable in their order, so that a revision
// that is there contains all before it.
//
// Errors of every call, beside those it names:
//   InvalidArgument BAD_STORE_KEY
//   ResourceExhausted DISK_FULL; what is stored stays as it was
//   DataLoss CATALOGUE_DAMAGED, ENTRY_DAMAGED, FILE_DAMAGED: read, but not
//     what was written; it is never handed out
//   Unavailable STORE_FAILED: the system refused, for a reason it tells
class Store {
 public:
  // Told once how an append ended, on any thread, with no lock of the store
  // held, perhaps before Append() returns. Must not block, nor call Sync().
  using Done = std::function<void(const absl::Status&)>;

  // Commits what was appended.
  virtual ~Store() = default;

  // Whether anything here outlives the process. If not, revisions are never to
  // be called durable.
  virtual bool survives_restart() const = 0;

  virtual absl::StatusOr<StoreContents> Load() = 0;

  // Keeps a model, or finds that it is here; arrays that were damaged or lost
  // are written again.
  virtual absl::Status PutModel(const StoredModel& model,
                                const StoredArrays& arrays) = 0;
  // NotFound MODEL_NOT_FOUND; DataLoss FILE_DAMAGED: the file was put aside.
  virtual absl::StatusOr<StoredArrays> ModelArrays(const StoreKey& model) = 0;
  // With its bindings and their sessions. NotFound MODEL_NOT_FOUND.
  virtual absl::Status DeleteModel(const StoreKey& model) = 0;

  // NotFound MODEL_NOT_FOUND.
  virtual absl::Status PutBinding(const StoredBinding& binding) = 0;
  // Replaces the weights that are kept. Weights can be computed again, so a
  // store may keep none; any that were put under one form will do, so that an
  // error may leave either. NotFound BINDING_NOT_FOUND.
  virtual absl::Status PutWeights(const StoreKey& binding,
                                  const WeightsForm& form,
                                  const StoredArrays& arrays) = 0;
  // NotFound BINDING_NOT_FOUND, WEIGHTS_NOT_STORED; DataLoss FILE_DAMAGED: put
  // aside, from then on WEIGHTS_NOT_STORED.
  virtual absl::StatusOr<StoredWeights> Weights(const StoreKey& binding) = 0;
  // With its sessions. NotFound BINDING_NOT_FOUND.
  virtual absl::Status DeleteBinding(const StoreKey& binding) = 0;

  // At rest. NotFound BINDING_NOT_FOUND; AlreadyExists SESSION_EXISTS;
  // InvalidArgument BAD_EPOCH for epoch 0.
  virtual absl::Status PutSession(const StoredSession& session) = 0;
  // The durable revision. NotFound SESSION_NOT_FOUND.
  virtual absl::StatusOr<SessionPose> LoadSession(const StoreKey& session) = 0;
  // Raises the epoch of each and returns them: appends of the epochs before are
  // refused from now on, those that wait included, and the first of the new one
  // is whole. All or none; it waits for the disk once. NotFound
  // SESSION_NOT_FOUND.
  virtual absl::StatusOr<std::vector<uint64_t>> TakeOver(
      std::span<const StoreKey> sessions) = 0;
  // NotFound SESSION_NOT_FOUND.
  virtual absl::Status DeleteSession(const StoreKey& session) = 0;

  // Accepts the next revision without waiting for a disk; it is durable once
  // `done` is told OK. A whole pose may leave revisions out; a change in part
  // must follow the revision before. If `done` is told an error, that revision
  // and those accepted after it are lost, and a whole pose must come next.
  // `done` is not called if this returns an error:
  //   NotFound SESSION_NOT_FOUND
  //   FailedPrecondition STALE_EPOCH (taken over), STALE_REVISION,
  //     REVISION_GAP
  //   InvalidArgument BAD_POSE
  //   ResourceExhausted JOURNAL_BEHIND: more waits than may
  virtual absl::Status Append(PoseAppend append, Done done) = 0;
  // Of the session; 0 if there is none.
  virtual uint64_t DurableRevision(const StoreKey& session) = 0;
  // Waits until all that was appended before is durable or has failed. Returns
  // how the disk failed since the last Sync(), if it did.
  virtual absl::Status Sync() = 0;

  // Removes files that nothing refers to, such as those that a crash left;
  // never what is being written. Returns how many.
  virtual absl::StatusOr<int64_t> CollectOrphans() = 0;

  // A copy of everything as it is at one instant, in `directory`, which must
  // not exist. Others go on meanwhile. Unimplemented by stores that keep
  // nothing; FailedPrecondition DIRECTORY_EXISTS.
  virtual absl::Status Backup(const std::string& directory) = 0;
};

struct StoreOptions {
  std::string directory;  // Made if it is not there; others in it are refused.
  FileSystem* files = &PosixFileSystem();
  const char* sqlite_vfs = nullptr;               // The system's own.
  int64_t max_waiting_bytes = int64_t{64} << 20;  // Of appends.
};

// A kind of store. Immutable.
class StoreKind {
 public:
  virtual ~StoreKind() = default;
  virtual absl::string_view id() const = 0;
  // FailedPrecondition DIRECTORY_IN_USE, which names the process;
  // FORMAT_TOO_NEW, NOT_A_STORE; DataLoss CATALOGUE_DAMAGED.
  virtual absl::StatusOr<std::unique_ptr<Store>> Open(
      const StoreOptions& options) const = 0;
};

std::span<const StoreKind* const> AllStoreKinds();
// NotFound UNKNOWN_STORE, which lists those there are.
absl::StatusOr<const StoreKind*> FindStoreKind(absl::string_view id);

}  // namespace deform::server
