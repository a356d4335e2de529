#include "server/sessions/session_manager.h"

#include <openssl/rand.h>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {
namespace {

// Nobody guesses it: 96 random bits.
absl::StatusOr<std::string> RandomId() {
  unsigned char bytes[12];
  if (RAND_bytes(bytes, sizeof(bytes)) != 1) {
    return absl::InternalError("no random numbers for a session id");
  }
  return absl::StrCat(
      "s-", absl::BytesToHexString(absl::string_view(
                reinterpret_cast<const char*>(bytes), sizeof(bytes))));
}

}  // namespace

absl::Status Draining() {
  return MakeError(absl::StatusCode::kUnavailable,
                   "the server is shutting down: try another, or later",
                   {.reason = "SERVER_DRAINING"});
}

SessionManager::SessionManager(BindingRegistry& bindings, const Limits& limits,
                               SessionEnvironment environment, Executor patient)
    : environment_(std::move(environment)),
      bindings_(bindings),
      budget_(limits.memory, "max-sessions-memory"),
      sessions_("session", limits.count, "max-sessions") {
  bindings_.compressor().SetListener(
      [this](const BindingRecord& record) { Refresh(record); });
  environment_.store = &store();
  environment_.wake =
      [this, patient = std::move(patient)](std::shared_ptr<Session> session) {
        patient([this, session = std::move(session)] {
          session->WakeUp([this](const auto& record) {
            return bindings_.WeightsOf(record, [this] { return !stopping_; });
          });
          // If the form has changed before the session could be told.
          session->Refresh();
        });
      };
}

SessionManager::~SessionManager() {
  bindings_.compressor().SetListener({});
  for (const auto& session : sessions_.All()) session->End(Draining());
}

absl::StatusOr<std::shared_ptr<Session>> SessionManager::Create(
    const std::string& tenant, const std::string& binding_id,
    const std::string& wanted_id, KeepWaiting keep_waiting) {
  std::string id = wanted_id;
  if (id.empty()) {
    DEFORM_ASSIGN_OR_RETURN(id, RandomId());
  }
  DEFORM_RETURN_IF_ERROR(CheckName(id, "session_id"));
  const Claims::Claim claim = claims_.Take(tenant, id);
  auto session = sessions_.Find(tenant, id);
  if (!session.ok()) {
    DEFORM_ASSIGN_OR_RETURN(const auto record,
                            bindings_.catalogue().Find(tenant, binding_id));
    DEFORM_ASSIGN_OR_RETURN(
        auto memory,
        budget_.Reserve(Session::BytesFor(record->facts), "the session needs"));
    DEFORM_ASSIGN_OR_RETURN(
        auto binding,
        bindings_.Use(tenant, binding_id, absl::StrCat("session ", id),
                      keep_waiting));
    session = Session::Create(id, std::move(binding), std::move(memory),
                              environment_);
    DEFORM_RETURN_IF_ERROR(
        Put({.key = {tenant, id},
             .binding_id = binding_id,
             .epoch = (*session)->epoch(),
             .create_time = (*session)->state().create_time}));
    const absl::Status inserted = Insert(tenant, id, *session);
    if (!inserted.ok()) {
      store().DeleteSession({tenant, id}).IgnoreError();
      return inserted;
    }
    // If the form has changed before the session could be told.
    (*session)->Refresh();
  }
  const std::string has = (*session)->state().binding_id;
  if (has != binding_id) {
    return MakeError(
        absl::StatusCode::kAlreadyExists,
        absl::StrCat("session ", Quoted(id), " has binding ", Quoted(has)),
        {.reason = "SESSION_EXISTS",
         .resource_type = "session",
         .resource_name = id});
  }
  return session;
}

absl::Status SessionManager::Put(const StoredSession& session) {
  const absl::Status status = store().PutSession(session);
  if (DetailOf(status).reason != "SESSION_EXISTS") return status;
  DEFORM_RETURN_IF_ERROR(store().DeleteSession(session.key));
  return store().PutSession(session);
}

absl::Status SessionManager::Insert(const std::string& tenant,
                                    const std::string& id,
                                    std::shared_ptr<Session> session) {
  // Under the lock of Drain(): it then sees every session that was made.
  MutexLock lock(mutex_);
  if (draining_) return Draining();
  return sessions_.Insert(tenant, id, std::move(session)).status();
}

absl::StatusOr<Losses> SessionManager::Load(
    const std::vector<StoredSession>& sessions) {
  Losses losses;
  const auto keep_or_lose = [&](const StoreKey& key,
                                const absl::Status& status) -> absl::Status {
    if (absl::IsDataLoss(status) || absl::IsNotFound(status)) {
      losses.push_back(Damaged("session", key.id, status, "create it again"));
      sessions_.Lose(key.tenant, key.id, losses.back());
      return absl::OkStatus();
    }
    return Annotate(status, absl::StrCat("session ", key.id, ": "));
  };
  std::vector<StoreKey> keys;
  std::vector<Start> starts;
  for (const StoredSession& session : sessions) {
    absl::StatusOr<Start> start = StartOf(session);
    if (start.ok()) {
      keys.push_back(session.key);
      starts.push_back(*std::move(start));
    } else {
      DEFORM_RETURN_IF_ERROR(keep_or_lose(session.key, start.status()));
    }
  }
  DEFORM_ASSIGN_OR_RETURN(const auto epochs, store().TakeOver(keys));
  for (size_t i = 0; i < keys.size(); ++i) {
    starts[i].stored.at.epoch = epochs[i];
    DEFORM_RETURN_IF_ERROR(
        keep_or_lose(keys[i], GoOn(keys[i].tenant, std::move(starts[i]))));
  }
  return losses;
}

absl::StatusOr<SessionManager::Start> SessionManager::StartOf(
    const StoredSession& stored) {
  const auto& [tenant, id] = stored.key;
  DEFORM_ASSIGN_OR_RETURN(auto at, store().LoadSession(stored.key));
  DEFORM_ASSIGN_OR_RETURN(
      auto binding,
      bindings_.Hold(tenant, at.binding_id, absl::StrCat("session ", id)));
  DEFORM_ASSIGN_OR_RETURN(
      auto memory, budget_.Reserve(Session::BytesFor(binding.record()->facts),
                                   "the stored session needs"));
  return Start{.stored = {.id = id,
                          .at = std::move(at),
                          .create_time = stored.create_time},
               .binding = std::move(binding),
               .memory = std::move(memory)};
}

absl::Status SessionManager::GoOn(const std::string& tenant, Start start) {
  const std::string id = start.stored.id;
  DEFORM_ASSIGN_OR_RETURN(
      auto session,
      Session::Restore(std::move(start.stored), std::move(start.binding),
                       std::move(start.memory), environment_));
  return sessions_.Insert(tenant, id, std::move(session)).status();
}

absl::Status SessionManager::CheckHave(const std::string& tenant,
                                       const std::vector<std::string>& ids,
                                       const std::string& binding_id) const {
  for (const std::string& id : ids) {
    DEFORM_ASSIGN_OR_RETURN(const auto session, sessions_.Find(tenant, id));
    const std::string has = session->state().binding_id;
    if (has == binding_id) continue;
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     absl::StrCat("session ", Quoted(id), " has binding ",
                                  Quoted(has), ", not ", Quoted(binding_id)),
                     {.reason = "OTHER_BINDING",
                      .resource_type = "session",
                      .resource_name = id});
  }
  return absl::OkStatus();
}

void SessionManager::Move(const BindingRecord& from, const BindingRecord& to,
                          const std::vector<int32_t>& previous,
                          std::vector<std::string> ids, RigMoves& moves) {
  if (ids.empty()) {
    for (const auto& session : sessions_.All()) {
      const SessionState state = session->state();
      if (state.tenant == from.tenant && state.binding_id == from.id) {
        ids.push_back(state.id);
      }
    }
  }
  for (const std::string& id : ids) {
    auto done = moves.Add(id);
    const auto move = [&]() -> absl::Status {
      DEFORM_ASSIGN_OR_RETURN(const auto session,
                              sessions_.Find(from.tenant, id));
      DEFORM_ASSIGN_OR_RETURN(
          auto memory,
          budget_.Reserve(Session::BytesFor(to.facts), "the session needs"));
      DEFORM_ASSIGN_OR_RETURN(
          auto binding,
          bindings_.Use(to.tenant, to.id, absl::StrCat("session ", id)));
      session->Move({.from = from.id,
                     .to = std::move(binding),
                     .memory = std::move(memory),
                     .previous = previous,
                     .done = done});
      return absl::OkStatus();
    };
    if (const absl::Status status = move(); !status.ok()) done(status);
  }
}

void SessionManager::Refresh(const BindingRecord& record) {
  for (const auto& session : sessions_.All()) {
    const SessionState state = session->state();
    if (state.tenant == record.tenant && state.binding_id == record.id) {
      session->Refresh();
    }
  }
}

absl::Status SessionManager::Delete(const std::string& tenant,
                                    const std::string& id) {
  const Claims::Claim claim = claims_.Take(tenant, id);
  DEFORM_ASSIGN_OR_RETURN(const auto session, sessions_.Remove(tenant, id, [&] {
    return store().DeleteSession({tenant, id});
  }));
  if (session == nullptr) return absl::OkStatus();  // It was lost.
  session->End(SessionDeleted(id));
  return absl::OkStatus();
}

void SessionManager::Drain() {
  {
    MutexLock lock(mutex_);
    draining_ = true;
  }
  for (const auto& session : sessions_.All()) session->Drain(Draining());
}

}  // namespace deform::server
