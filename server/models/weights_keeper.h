// The weights of bindings in the store: put there in the background, and read
// from there by who needs them, so that they are computed once.
#pragma once

#include <deque>
#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "core/base/mutex.h"
#include "core/weights/binding.h"
#include "server/models/binding_record.h"
#include "server/stores/store.h"

namespace deform::server {

// One binding at a time. Whatever the store refuses is told and costs time
// only: weights can be computed again. Thread-safe.
class WeightsKeeper {
 public:
  struct Options {
    // Runs a task soon, never inside the call; it waits for a disk. None:
    // weights are not kept.
    std::function<void(std::function<void()>)> executor;
    // Told what went wrong, on any thread, with no lock held. May be empty.
    std::function<void(const absl::Status&)> report;
  };

  // The store is borrowed.
  WeightsKeeper(Store& store, Options options);
  // What has not begun is not kept; waits for the rest.
  ~WeightsKeeper();

  // The weights of `record` are in the form in which they will stay. They are
  // put into the store, unless they are there in this form.
  void Add(const std::shared_ptr<const BindingRecord>& record);

  // The weights of `record` as they were kept, verified, in the memory of the
  // file. Null if there are none that are sound.
  std::shared_ptr<const Binding> Read(const BindingRecord& record);

 private:
  void Work();
  void Keep(const std::weak_ptr<const BindingRecord>& record);

  Store& store_;
  const Options options_;
  Mutex mutex_;
  CondVar changed_;
  // A binding that is removed meanwhile is not held by this.
  std::deque<std::weak_ptr<const BindingRecord>> waiting_
      ABSL_GUARDED_BY(mutex_);
  bool running_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace deform::server
