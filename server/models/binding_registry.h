// Bindings: computed once for everyone who asks the same, then kept, in memory
// and in the store. Their weights may be dropped while nobody uses them; they
// are read from the store, or computed again, when somebody does.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "core/base/thread_pool.h"
#include "core/weights/binding.h"
#include "server/models/binding_record.h"
#include "server/models/catalogue.h"
#include "server/models/claims.h"
#include "server/models/compressor.h"
#include "server/models/losses.h"
#include "server/models/memory_budget.h"
#include "server/models/model_registry.h"
#include "server/models/weights_cache.h"
#include "server/models/weights_keeper.h"

namespace deform::server {

// What a client asks for; everything that is not the model is already right.
struct BindSpec {
  std::string tenant;
  std::string model_id;
  Rig rig;
  std::string scheme;
  SchemeOptions options;
  ExitRegions exits;
  Unbindable unbindable = Unbindable::kFail;
  std::vector<int64_t> clamped;  // Sorted, each once.
  // The weights are compressed to this (compress_binding.h); 0: they are dense.
  double weight_tolerance = 0;
  // Where the search for the weights starts (BindControl); no part of what is
  // asked for.
  std::shared_ptr<const Solutions> known;
};

// What the weights take if they are dense, with what solvers keep beside them.
int64_t DenseWeightBytes(const BindingFacts& facts);

using BindingCatalogue = Catalogue<const BindingRecord>;

// A binding whose weights are here, and stay while this lives.
struct CreatedBinding {
  std::shared_ptr<const BindingRecord> record;
  std::shared_ptr<const Binding> binding;
  bool existed = false;
};

// A binding that can be neither removed nor evicted while this lives.
struct BindingInUse {
  BindingCatalogue::Lease lease;
  std::shared_ptr<const Binding> binding;
};

// Asked a few times a second by who waits for a computation; false: give up.
using KeepWaiting = absl::FunctionRef<bool()>;
inline bool WaitForever() { return true; }

// Thread-safe.
class BindingRegistry {
  struct Job;

 public:
  struct Limits {
    int64_t memory;  // Of all bindings, those being computed included.
    int64_t count;
    int concurrent;     // Computations at a time; others wait their turn.
    int waiting_calls;  // Callers that wait for a computation at a time.
  };
  using BindFunction =
      std::function<absl::StatusOr<std::shared_ptr<const Binding>>(
          const BindRequest&, const BindControl&)>;

  // A caller's share in a computation. The last one to leave before the end
  // cancels it.
  class Waiter {
   public:
    ~Waiter();
    Waiter(const Waiter&) = delete;
    Waiter& operator=(const Waiter&) = delete;

    // The outcome, or nullopt if `timeout` passed first.
    std::optional<absl::StatusOr<CreatedBinding>> Wait(
        std::chrono::milliseconds timeout);
    BindProgress progress() const;

   private:
    friend class BindingRegistry;
    Waiter(BindingRegistry& registry, std::shared_ptr<Job> job)
        : registry_(registry), job_(std::move(job)) {}

    BindingRegistry& registry_;
    const std::shared_ptr<Job> job_;
  };

  // Computes on `pool`. Models, with their store, and pool are borrowed. `bind`
  // is a parameter for tests.
  BindingRegistry(ModelRegistry& models, ThreadPool& pool, const Limits& limits,
                  BindFunction bind = &Bind,
                  Compressor::Options compression = {},
                  WeightsKeeper::Options keeping = {});
  // Cancels what is being computed and waits for it.
  ~BindingRegistry();

  // Brings in what the store has, without weights; nobody else uses the
  // registry yet. What cannot be read, or its model, is lost until it is
  // created again: DataLoss to whoever asks for it. ResourceExhausted if there
  // is more than the limits allow.
  absl::StatusOr<Losses> Load(const std::vector<StoredBinding>& bindings);

  // Finds the binding and its weights, joins their computation, or queues one.
  // NotFound MODEL_NOT_FOUND, UNKNOWN_SCHEME; ResourceExhausted MEMORY_LIMIT,
  // TOO_MANY_BINDS. What Bind() or the store refuses is told by the waiter:
  // then there is no binding.
  absl::StatusOr<std::unique_ptr<Waiter>> Create(BindSpec spec);

  // The binding for `user`, with its weights: waits for them if they were
  // evicted. NotFound BINDING_NOT_FOUND, Cancelled, and what Create() and its
  // waiter refuse.
  absl::StatusOr<BindingInUse> Use(const std::string& tenant,
                                   const std::string& id,
                                   const std::string& user,
                                   KeepWaiting keep_waiting = WaitForever);
  // Keeps the binding for `user` without its weights. As Find().
  absl::StatusOr<BindingCatalogue::Lease> Hold(const std::string& tenant,
                                               const std::string& id,
                                               const std::string& user) {
    return bindings_.Use(tenant, id, user);
  }
  // The weights without keeping the binding from being removed.
  absl::StatusOr<std::shared_ptr<const Binding>> WeightsOf(
      const std::shared_ptr<const BindingRecord>& record,
      KeepWaiting keep_waiting = WaitForever);

  // NotFound; FailedPrecondition BINDING_IN_USE; what the store refuses: then
  // it stays.
  absl::Status Remove(const std::string& tenant, const std::string& id);

  // Set while the weights of this binding are being computed again.
  std::optional<BindProgress> ProgressOf(const BindingRecord& record);

  // Replaces dense weights by compressed ones where that was asked for.
  Compressor& compressor() { return compressor_; }
  ModelRegistry& models() { return models_; }
  Store& store() { return models_.store(); }
  MemoryBudget& budget() { return weights_.budget(); }
  // To look things up; Use() and Remove() are here.
  const BindingCatalogue& catalogue() const { return bindings_; }

 private:
  using Key = std::pair<std::string, std::string>;  // Tenant, binding id.

  // The job for `key` that is under way, or else what `make` returns.
  absl::StatusOr<std::unique_ptr<Waiter>> Join(
      const Key& key,
      absl::FunctionRef<absl::StatusOr<std::shared_ptr<Job>>()> make);
  // Nothing but an outcome if the weights are here.
  absl::StatusOr<std::shared_ptr<Job>> MakeJobFor(
      const std::shared_ptr<const BindingRecord>& known);
  absl::StatusOr<std::shared_ptr<Job>> MakeJob(const Key& key, BindSpec spec);
  // Reserves for dense weights or, if these do not fit, for compressed ones
  // that are made without them.
  absl::Status Reserve(Job& job, const CoordinateScheme& scheme,
                       absl::string_view what);
  void StartJobs() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Abandon(const std::shared_ptr<Job>& job)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Run(std::shared_ptr<Job> job);
  void Forget(const std::shared_ptr<Job>& job)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<CreatedBinding> Compute(Job& job);
  // The weights of a binding that is known: read, or else computed.
  absl::StatusOr<CreatedBinding> Restore(Job& job);
  absl::StatusOr<CreatedBinding> Keep(
      std::shared_ptr<const BindingRecord> record,
      std::shared_ptr<const Binding> binding);
  absl::Status LoadOne(const StoredBinding& stored);
  absl::StatusOr<std::shared_ptr<const Binding>> ComputeWeights(Job& job) const;

  const Limits limits_;
  const BindFunction bind_;
  ModelRegistry& models_;
  ThreadPool& pool_;
  WeightsCache weights_;
  BindingCatalogue bindings_;
  Claims claims_;
  WeightsKeeper keeper_;
  Compressor compressor_;

  Mutex mutex_;
  CondVar changed_;
  std::map<Key, std::shared_ptr<Job>> jobs_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::shared_ptr<Job>> queue_ ABSL_GUARDED_BY(mutex_);
  int running_ ABSL_GUARDED_BY(mutex_) = 0;
  int waiting_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace deform::server
