// The store of a server that keeps nothing: gone with the process. It shares
// the arrays of models with whoever brought them, and keeps no weights.
#include <map>
#include <memory>
#include <utility>

#include "core/base/error.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "server/stores/poses.h"
#include "server/stores/store.h"
#include "server/stores/store_errors.h"

namespace deform::server {
namespace {

class MemoryStore : public Store {
 public:
  bool survives_restart() const override { return false; }

  absl::StatusOr<StoreContents> Load() override {
    MutexLock lock(mutex_);
    StoreContents contents;
    for (const auto& [key, model] : models_) {
      contents.models.push_back(model.row);
    }
    for (const auto& [key, row] : bindings_) contents.bindings.push_back(row);
    for (const auto& [key, session] : sessions_) {
      StoredSession row = session.row;
      row.epoch = session.pose.epoch;
      row.binding_id = session.pose.binding_id;
      contents.sessions.push_back(std::move(row));
    }
    return contents;
  }

  absl::Status PutModel(const StoredModel& model,
                        const StoredArrays& arrays) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(model.key));
    MutexLock lock(mutex_);
    models_[model.key] = {model, arrays};
    return absl::OkStatus();
  }

  absl::StatusOr<StoredArrays> ModelArrays(const StoreKey& key) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(key));
    MutexLock lock(mutex_);
    const auto model = models_.find(key);
    if (model == models_.end()) return NotStored("model", key);
    return model->second.arrays;
  }

  absl::Status DeleteModel(const StoreKey& key) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(key));
    MutexLock lock(mutex_);
    if (models_.erase(key) == 0) return NotStored("model", key);
    std::erase_if(bindings_, [&](const auto& entry) {
      return StoreKey{entry.first.tenant, entry.second.model_id} == key;
    });
    DropUnboundSessions();
    return absl::OkStatus();
  }

  absl::Status PutBinding(const StoredBinding& binding) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding.key));
    MutexLock lock(mutex_);
    const StoreKey model = {binding.key.tenant, binding.model_id};
    if (!models_.contains(model)) return NotStored("model", model);
    bindings_[binding.key] = binding;
    return absl::OkStatus();
  }

  absl::Status PutWeights(const StoreKey& binding, const WeightsForm& form,
                          const StoredArrays& /*arrays*/) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding));
    DEFORM_RETURN_IF_ERROR(CheckForm(form));
    MutexLock lock(mutex_);
    return bindings_.contains(binding) ? absl::OkStatus()
                                       : NotStored("binding", binding);
  }

  absl::StatusOr<StoredWeights> Weights(const StoreKey& binding) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding));
    MutexLock lock(mutex_);
    if (!bindings_.contains(binding)) return NotStored("binding", binding);
    return WeightsNotStored(binding);
  }

  absl::Status DeleteBinding(const StoreKey& binding) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(binding));
    MutexLock lock(mutex_);
    if (bindings_.erase(binding) == 0) return NotStored("binding", binding);
    DropUnboundSessions();
    return absl::OkStatus();
  }

  absl::Status PutSession(const StoredSession& session) override {
    DEFORM_RETURN_IF_ERROR(CheckKey(session.key));
    DEFORM_RETURN_IF_ERROR(CheckEpoch(session.epoch));
    MutexLock lock(mutex_);
    const StoreKey binding = {session.key.tenant, session.binding_id};
    if (!bindings_.contains(binding)) return NotStored("binding", binding);
    const bool made =
        sessions_
            .emplace(session.key,
                     Session{.row = session,
                             .pose = {.binding_id = session.binding_id,
                                      .epoch = session.epoch}})
            .second;
    return made ? absl::OkStatus() : SessionExists(session.key);
  }

  absl::StatusOr<SessionPose> LoadSession(const StoreKey& key) override {
    MutexLock lock(mutex_);
    const auto session = sessions_.find(key);
    if (session == sessions_.end()) return NotStored("session", key);
    return session->second.pose;
  }

  absl::StatusOr<std::vector<uint64_t>> TakeOver(
      std::span<const StoreKey> keys) override {
    MutexLock lock(mutex_);
    std::vector<Session*> taken;
    for (const StoreKey& key : keys) {
      const auto session = sessions_.find(key);
      if (session == sessions_.end()) return NotStored("session", key);
      taken.push_back(&session->second);
    }
    std::vector<uint64_t> epochs;
    for (Session* session : taken) {
      session->needs_whole = true;
      epochs.push_back(++session->pose.epoch);
    }
    return epochs;
  }

  absl::Status DeleteSession(const StoreKey& key) override {
    MutexLock lock(mutex_);
    return sessions_.erase(key) > 0 ? absl::OkStatus()
                                    : NotStored("session", key);
  }

  absl::Status Append(PoseAppend append, Done done) override {
    DEFORM_RETURN_IF_ERROR(Accept(append));
    if (done) done(absl::OkStatus());
    return absl::OkStatus();
  }

  uint64_t DurableRevision(const StoreKey& key) override {
    MutexLock lock(mutex_);
    const auto session = sessions_.find(key);
    return session == sessions_.end() ? 0 : session->second.pose.revision;
  }

  absl::Status Sync() override { return absl::OkStatus(); }
  absl::StatusOr<int64_t> CollectOrphans() override { return 0; }
  absl::Status Backup(const std::string& /*directory*/) override {
    return MakeError(absl::StatusCode::kUnimplemented,
                     "a server in memory has nothing to back up",
                     {.reason = "NOTHING_STORED"});
  }

 private:
  struct Model {
    StoredModel row;
    StoredArrays arrays;
  };
  struct Session {
    StoredSession row;
    SessionPose pose;
    bool needs_whole = false;
  };

  absl::Status Accept(const PoseAppend& append) {
    MutexLock lock(mutex_);
    const auto found = sessions_.find(append.session);
    if (found == sessions_.end()) return NotStored("session", append.session);
    Session& session = found->second;
    const PoseHead head{
        .epoch = session.pose.epoch,
        .accepted = session.pose.revision,
        .rows = session.needs_whole ? 0 : session.pose.pose.vertices.rows()};
    DEFORM_RETURN_IF_ERROR(CheckFollows(append, append.revision - 1, head));
    const StoreKey binding = {append.session.tenant, append.binding_id};
    if (!append.binding_id.empty() && !bindings_.contains(binding)) {
      return NotStored("binding", binding);
    }
    Apply(append, session.pose);
    session.needs_whole = false;
    return absl::OkStatus();
  }

  void DropUnboundSessions() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    std::erase_if(sessions_, [&](const auto& entry) {
      return !bindings_.contains(
          {entry.first.tenant, entry.second.pose.binding_id});
    });
  }

  Mutex mutex_;
  std::map<StoreKey, Model> models_ ABSL_GUARDED_BY(mutex_);
  std::map<StoreKey, StoredBinding> bindings_ ABSL_GUARDED_BY(mutex_);
  std::map<StoreKey, Session> sessions_ ABSL_GUARDED_BY(mutex_);
};

class Memory : public StoreKind {
 public:
  absl::string_view id() const override { return "memory"; }
  absl::StatusOr<std::unique_ptr<Store>> Open(
      const StoreOptions& /*options*/) const override {
    return std::make_unique<MemoryStore>();
  }
};

}  // namespace

const StoreKind& MemoryStoreKind() {
  static const Memory kind;
  return kind;
}

}  // namespace deform::server
