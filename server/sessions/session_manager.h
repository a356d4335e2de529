// The sessions of the server.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/models/binding_registry.h"
#include "server/models/catalogue.h"
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

  // Bindings are borrowed; so is what the environment points to.
  SessionManager(BindingRegistry& bindings, const Limits& limits,
                 SessionEnvironment environment);
  // Ends what is left.
  ~SessionManager();

  // `id` may be empty: one is made. The session that is there if it has the
  // same binding, else AlreadyExists SESSION_EXISTS. Waits for weights that
  // were evicted. NotFound BINDING_NOT_FOUND, InvalidArgument BAD_NAME,
  // ResourceExhausted MEMORY_LIMIT, TOO_MANY_SESSIONS, TOO_MANY_BINDS,
  // Cancelled, Unavailable SERVER_DRAINING.
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

  // Ends its streams with NotFound SESSION_DELETED.
  absl::Status Delete(const std::string& tenant, const std::string& id);

  // No new sessions or participants; streams end with Unavailable
  // SERVER_DRAINING once the poses that came are answered.
  void Drain();

  SessionCatalogue& catalogue() { return sessions_; }
  const Clock& clock() const { return environment_.clock; }

 private:
  // The weights of this binding have another form.
  void Refresh(const BindingRecord& record);

  const SessionEnvironment environment_;
  BindingRegistry& bindings_;
  MemoryBudget budget_;
  SessionCatalogue sessions_;
  mutable Mutex mutex_;
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
};

// Unavailable SERVER_DRAINING.
absl::Status Draining();

}  // namespace deform::server
