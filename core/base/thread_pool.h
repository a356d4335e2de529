// A fixed set of threads for computation. Nothing that blocks runs on it.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "absl/functional/function_ref.h"
#include "core/base/cancellation.h"
#include "core/base/mutex.h"

namespace deform {

class ThreadPool {
 public:
  struct Options {
    // 0 means one per core.
    int threads = 0;
    // Added to the threads' nice value, so that long work yields to short.
    int niceness = 0;
  };

  explicit ThreadPool(const Options& options);
  // Finishes what was submitted.
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const { return static_cast<int>(threads_.size()); }

  // Runs `task` on one of the threads. Thread-safe.
  void Submit(std::function<void()> task);

  // Calls body(i) for every i of [0, count), in any order, on the pool and on
  // the caller's thread, and returns when all are done. May be called from
  // within a body or a task. Returns false, with some calls not made, if
  // `cancellation` (which may be null) was cancelled before the last began.
  bool ParallelFor(int64_t count, const Cancellation* cancellation,
                   absl::FunctionRef<void(int64_t)> body);

 private:
  void Work();

  Mutex mutex_;
  CondVar wake_;
  std::deque<std::function<void()>> tasks_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

// pool->ParallelFor(), or, without a pool, the same on the caller's thread.
bool ParallelFor(ThreadPool* pool, int64_t count,
                 const Cancellation* cancellation,
                 absl::FunctionRef<void(int64_t)> body);

}  // namespace deform
