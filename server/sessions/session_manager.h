// The sessions of the server.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/models/binding_registry.h"
#include "server/models/catalogue.h"
#include "server/models/claims.h"
#include "server/models/losses.h"
#include "server/sessions/rig_moves.h"
#include "server/sessions/session.h"

namespace deform::server {

using SessionCatalogue = Catalogue<Session>;

// Thread-safe.
class SessionManager {
 public:
  struct Limits {
    int64_t memory;  // Of all sessions.
    int64_t count;
  };

  // Bindings, with their store, are borrowed; so is what the environment points
  // to. `patient` runs tasks soon, never inside the call, which may wait for
  // weights: only sessions that were stored need it.
  SessionManager(BindingRegistry& bindings, const Limits& limits,
                 SessionEnvironment environment, Executor patient = {});
  // Ends what is left.
  ~SessionManager();

  // Brings in what the store has, in a new epoch each, asleep (see Session);
  // nobody else uses the manager yet. What cannot be read, or its binding, is
  // lost until it is created again: DataLoss to whoever asks for it.
  // ResourceExhausted if there is more than the limits allow; what the store
  // refuses.
  absl::StatusOr<Losses> Load(const std::vector<StoredSession>& sessions);

  // `id` may be empty: one is made. The session that is there if it has the
  // same binding, else AlreadyExists SESSION_EXISTS. Waits for weights that
  // were evicted. NotFound BINDING_NOT_FOUND, InvalidArgument BAD_NAME,
  // ResourceExhausted MEMORY_LIMIT, TOO_MANY_SESSIONS, TOO_MANY_BINDS,
  // Cancelled, Unavailable SERVER_DRAINING, what the store refuses: then there
  // is no session.
  absl::StatusOr<std::shared_ptr<Session>> Create(
      const std::string& tenant, const std::string& binding_id,
      const std::string& id, KeepWaiting keep_waiting = WaitForever);

  // NotFound SESSION_NOT_FOUND; FailedPrecondition OTHER_BINDING unless these
  // sessions have that binding.
  absl::Status CheckHave(const std::string& tenant,
                         const std::vector<std::string>& ids,
                         const std::string& binding_id) const;

  // Has sessions of `from` move to `to`, a binding of its edited handles: those
  // that are named, or all that it has now. `previous` as in EditedHandles.
  // Does not wait; `moves` is told of each how it went.
  void Move(const BindingRecord& from, const BindingRecord& to,
            const std::vector<int32_t>& previous, std::vector<std::string> ids,
            RigMoves& moves);

  // Ends its streams with NotFound SESSION_DELETED. What the store refuses:
  // then it goes on.
  absl::Status Delete(const std::string& tenant, const std::string& id);

  // No new sessions or participants; streams end with Unavailable
  // SERVER_DRAINING once the poses that came are answered.
  void Drain();
  // Sessions that wake up wait for weights no longer.
  void StopWaiting() { stopping_ = true; }

  SessionCatalogue& catalogue() { return sessions_; }
  const Clock& clock() const { return environment_.clock; }
  FrameTables& frame_tables() { return *environment_.frame_tables; }

 private:
  Store& store() { return bindings_.store(); }
  // What a stored session needs to go on, but for its epoch.
  struct Start {
    StoredStart stored;
    BindingCatalogue::Lease binding;
    MemoryBudget::Reservation memory;
  };
  absl::StatusOr<Start> StartOf(const StoredSession& stored);
  absl::Status GoOn(const std::string& tenant, Start start);
  // Into the store, in the place of one that was lost.
  absl::Status Put(const StoredSession& session);
  absl::Status Insert(const std::string& tenant, const std::string& id,
                      std::shared_ptr<Session> session);
  // The weights of this binding have another form.
  void Refresh(const BindingRecord& record);

  SessionEnvironment environment_;
  BindingRegistry& bindings_;
  MemoryBudget budget_;
  SessionCatalogue sessions_;
  Claims claims_;
  std::atomic<bool> stopping_ = false;
  mutable Mutex mutex_;
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
};

// Unavailable SERVER_DRAINING.
absl::Status Draining();

}  // namespace deform::server
