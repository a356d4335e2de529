// Puts compressed weights in the place of dense ones, in the background.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "core/base/thread_pool.h"
#include "core/weights/binding.h"
#include "core/weights/compress_binding.h"
#include "server/models/binding_record.h"
#include "server/models/memory_budget.h"

namespace deform::server {

// Compressed weights take the place of dense ones if these are at least so many
// times as large; else what they save is not worth their error. Those that are
// made where dense ones do not fit must be smaller still, or refused: so much
// is set aside for them.
inline constexpr int64_t kLeastRatio = 2;
inline constexpr int64_t kLeastRatioAtOnce = 4;

struct BindProgress {
  int64_t points_done = 0;
  int64_t points_total = 0;
};

// One binding at a time, in the order they came: a second one at the same time
// would take memory and end no sooner. Dense weights serve meanwhile, and stay
// if their budget has no room to compress them, or if compressed ones would not
// keep the tolerance or be much smaller: their slot tells why. Thread-safe.
class Compressor {
 public:
  using Compress = std::function<absl::StatusOr<std::shared_ptr<const Binding>>(
      const Binding& dense, double tolerance, const BindControl&)>;
  struct Options {
    // Runs a task soon, never inside the call. None: nothing is compressed.
    std::function<void(std::function<void()>)> executor;
    ThreadPool* pool = nullptr;  // Shares the work; may be null. Borrowed.
    // Parameters for tests.
    Compress compress = [](const Binding& dense, double tolerance,
                           const BindControl& control) {
      return CompressBinding(dense, &dense.weights(), tolerance, control,
                             dense.solutions());
    };
    std::function<bool(int64_t dense_bytes)> is_worth = &WorthCompressing;
  };
  // Told of a binding whose weights stay in the form that they have now.
  using Settled =
      std::function<void(const std::shared_ptr<const BindingRecord>&)>;
  // Told of a binding whose weights are in another form now.
  using Listener = std::function<void(const BindingRecord&)>;

  Compressor(MemoryBudget& budget, Options options, Settled settled = {});
  // Waits until nothing runs.
  ~Compressor();

  // The weights of `record` are here, as they were computed or kept. Nothing
  // but being settled happens if it does not ask for others.
  void Add(const std::shared_ptr<const BindingRecord>& record);
  // It is to be forgotten: its weights are let go soon.
  void Cancel(const BindingRecord& record);
  // Cancels all, and takes no more.
  void Stop();

  // Returns when the former one is not called any more.
  void SetListener(Listener listener);

  // Set while it waits for its turn or is being compressed.
  std::optional<BindProgress> ProgressOf(const BindingRecord& record) const;

  bool IsWorth(int64_t dense_bytes) const {
    return options_.is_worth(dense_bytes);
  }
  // What compressing needs beside the weights.
  int64_t WorkingBytes(int64_t points, int64_t columns) const;

 private:
  struct Task {
    // A binding that is removed meanwhile is not kept by this.
    std::weak_ptr<const BindingRecord> record;
    const BindingRecord* key = nullptr;
    int64_t points_total = 0;
    std::atomic<int64_t> points_done = 0;
    Cancellation cancellation;
  };

  std::shared_ptr<Task> Find(const BindingRecord& record) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Start() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Work();
  void Run(Task& task);
  void Settle(const std::shared_ptr<const BindingRecord>& record) const {
    if (settled_) settled_(record);
  }
  // OK if compressed weights have taken the place, else why dense ones stay.
  absl::Status Replace(const BindingRecord& record, Task& task);

  MemoryBudget& budget_;
  const Options options_;
  const Settled settled_;

  mutable Mutex mutex_;
  CondVar changed_;
  // The first is the one that runs.
  std::deque<std::shared_ptr<Task>> tasks_ ABSL_GUARDED_BY(mutex_);
  bool running_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;

  Mutex listener_mutex_;  // Comes before those of sessions.
  Listener listener_ ABSL_GUARDED_BY(listener_mutex_);
};

}  // namespace deform::server
