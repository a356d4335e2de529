// Bindings: computed once for everyone who asks the same, then kept.
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

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "core/base/thread_pool.h"
#include "core/weights/binding.h"
#include "server/models/catalogue.h"
#include "server/models/memory_budget.h"
#include "server/models/model_registry.h"

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
};

struct BindingRecord {
  std::string tenant;
  std::string id;  // Content address of the whole BindSpec.
  std::string model_id;
  std::shared_ptr<const Binding> binding;
  absl::Time create_time;
  MemoryBudget::Reservation memory;
  ModelCatalogue::Lease model;  // The model stays while its binding does.
};

using BindingCatalogue = Catalogue<const BindingRecord>;

struct BindProgress {
  int64_t points_done = 0;
  int64_t points_total = 0;
};

struct CreatedBinding {
  std::shared_ptr<const BindingRecord> record;
  bool existed = false;
};

// Thread-safe.
class BindingRegistry {
  struct Job;

 public:
  struct Limits {
    int64_t memory;  // Of all bindings.
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

  // Computes on `pool`. Models and pool are borrowed. `bind` is a parameter for
  // tests.
  BindingRegistry(ModelRegistry& models, ThreadPool& pool, const Limits& limits,
                  BindFunction bind = &Bind);
  // Cancels what is being computed and waits for it.
  ~BindingRegistry();

  // Finds the binding, joins its computation, or queues one. NotFound
  // MODEL_NOT_FOUND, UNKNOWN_SCHEME; ResourceExhausted MEMORY_LIMIT,
  // TOO_MANY_BINDS. What Bind() refuses is told by the waiter.
  absl::StatusOr<std::unique_ptr<Waiter>> Create(BindSpec spec);

  MemoryBudget& budget() { return budget_; }
  BindingCatalogue& catalogue() { return bindings_; }

 private:
  using Key = std::pair<std::string, std::string>;  // Tenant, binding id.

  absl::StatusOr<std::shared_ptr<Job>> MakeJob(const Key& key, BindSpec spec)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void StartJobs() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Abandon(const std::shared_ptr<Job>& job)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Run(std::shared_ptr<Job> job);
  absl::StatusOr<CreatedBinding> Compute(Job& job);

  const Limits limits_;
  const BindFunction bind_;
  ModelRegistry& models_;
  ThreadPool& pool_;
  MemoryBudget budget_;
  BindingCatalogue bindings_;

  Mutex mutex_;
  CondVar changed_;
  std::map<Key, std::shared_ptr<Job>> jobs_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::shared_ptr<Job>> queue_ ABSL_GUARDED_BY(mutex_);
  int running_ ABSL_GUARDED_BY(mutex_) = 0;
  int waiting_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace deform::server
