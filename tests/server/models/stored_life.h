// Registries over a store on a simulated disk, as one server has them.
#pragma once

#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/mutex.h"
#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/stores/store.h"
#include "tests/server/stores/simulated_disk.h"
#include "tests/support/shapes.h"

namespace deform::server {

inline absl::StatusOr<std::unique_ptr<Store>> OpenOn(SimulatedDisk& disk) {
  StoreOptions options;
  options.directory = "/data";
  options.files = &disk;
  options.sqlite_vfs = disk.vfs();
  return (*FindStoreKind("sqlite"))->Open(options);
}

// What was told, on whatever thread.
class Reports {
 public:
  void Add(const absl::Status& status) {
    MutexLock lock(mutex_);
    all_.push_back(status);
  }
  std::vector<absl::Status> all() const {
    MutexLock lock(mutex_);
    return all_;
  }

 private:
  mutable Mutex mutex_;
  std::vector<absl::Status> all_ ABSL_GUARDED_BY(mutex_);
};

// From opening the store to its end. Compressing and keeping weights runs when
// told.
class Life {
 public:
  struct Limits {
    int64_t models = 10;
    int64_t model_memory = 1 << 20;
    int64_t binding_memory = 64 << 20;
  };

  explicit Life(SimulatedDisk& disk) : Life(disk, Limits()) {}
  Life(SimulatedDisk& disk, const Limits& limits)
      : store_(OpenOn(disk).value()),
        models_({.model_bytes = 1 << 20,
                 .memory = limits.model_memory,
                 .count = limits.models},
                *store_),
        bindings_(
            models_, pool_,
            {.memory = limits.binding_memory,
             .count = 10,
             .concurrent = 1,
             .waiting_calls = 10},
            [this](const BindRequest& request, const BindControl& control) {
              ++computed;
              return Bind(request, control);
            },
            {.executor = Later(), .is_worth = [](int64_t) { return true; }},
            {.executor = Later(), .report = [this](const absl::Status& status) {
               reported.Add(status);
             }}) {}

  // Everything that is stored; what is lost.
  absl::StatusOr<Losses> Load() {
    auto contents = store_->Load();
    if (!contents.ok()) return contents.status();
    auto losses = models_.Load(contents->models);
    if (!losses.ok()) return losses;
    const auto more = bindings_.Load(contents->bindings);
    if (!more.ok()) return more;
    losses->insert(losses->end(), more->begin(), more->end());
    return losses;
  }

  absl::StatusOr<std::string> Register(Mesh mesh) {
    auto registered = models_.Register("t", "a name", std::move(mesh));
    if (!registered.ok()) return registered.status();
    return registered->record->id;
  }
  absl::StatusOr<CreatedBinding> Create(BindSpec spec) {
    const auto waiter = bindings_.Create(std::move(spec));
    if (!waiter.ok()) return waiter.status();
    return (*waiter)->Wait(std::chrono::minutes(1)).value();
  }
  std::shared_ptr<const BindingRecord> Find(const std::string& id) {
    return bindings_.catalogue().Find("t", id).value();
  }

  void RunAll() {
    while (!tasks_.empty()) {
      const auto task = std::move(tasks_.front());
      tasks_.pop_front();
      task();
    }
  }

  Store& store() { return *store_; }
  ModelRegistry& models() { return models_; }
  BindingRegistry& bindings() { return bindings_; }

  int computed = 0;
  Reports reported;

 private:
  std::function<void(std::function<void()>)> Later() {
    return [this](std::function<void()> task) {
      tasks_.push_back(std::move(task));
    };
  }

  std::deque<std::function<void()>> tasks_;
  const std::unique_ptr<Store> store_;
  ThreadPool pool_{{.threads = 1}};
  ModelRegistry models_;
  BindingRegistry bindings_;

 public:
  // What is left to do is done before the registries wait for it.
  ~Life() { RunAll(); }
};

inline BindSpec InCube(const std::string& model_id, double half_size = 1) {
  return {.tenant = "t",
          .model_id = model_id,
          .rig = CageOf(
              Cuboid(Vec3::Constant(-half_size), Vec3::Constant(half_size))),
          .scheme = "green"};
}

}  // namespace deform::server
