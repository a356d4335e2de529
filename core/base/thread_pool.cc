#include "core/base/thread_pool.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <utility>

namespace deform {
namespace {

// One ParallelFor. Helpers that start after the last index was taken find
// nothing to do; they keep the loop alive, but no longer touch the body.
struct Loop {
  Loop(int64_t n, const Cancellation* c, absl::FunctionRef<void(int64_t)> b)
      : count(n), cancellation(c), body(b) {}

  void Run() {
    for (int64_t index = Begin(); index >= 0; index = Begin()) {
      body(index);
      End();
    }
  }

  // The next index, or -1 if there is none to take.
  int64_t Begin() {
    MutexLock lock(mutex);
    if (next == count || cancelled) return -1;
    if (cancellation != nullptr && cancellation->cancelled()) {
      cancelled = true;
      return -1;
    }
    ++running;
    return next++;
  }

  void End() {
    MutexLock lock(mutex);
    if (--running == 0) done.NotifyAll();
  }

  // Waits until no body runs any more.
  bool Finish() {
    MutexLock lock(mutex);
    while (running > 0) done.Wait(mutex);
    return !cancelled;
  }

  const int64_t count;
  const Cancellation* const cancellation;
  const absl::FunctionRef<void(int64_t)> body;
  Mutex mutex;
  CondVar done;
  int64_t next ABSL_GUARDED_BY(mutex) = 0;
  int64_t running ABSL_GUARDED_BY(mutex) = 0;
  bool cancelled ABSL_GUARDED_BY(mutex) = false;
};

}  // namespace

ThreadPool::ThreadPool(const Options& options) {
  const int count = options.threads > 0
                        ? options.threads
                        : std::max(1u, std::thread::hardware_concurrency());
  for (int i = 0; i < count; ++i) {
    threads_.emplace_back([this, niceness = options.niceness] {
      // On Linux a thread's nice value is its own; failing to yield is no
      // error.
      if (niceness > 0) setpriority(PRIO_PROCESS, gettid(), niceness);
      Work();
    });
  }
}

ThreadPool::~ThreadPool() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.NotifyAll();
  for (std::thread& thread : threads_) thread.join();
}

void ThreadPool::Submit(std::function<void()> task) {
  {
    MutexLock lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  wake_.NotifyOne();
}

bool ThreadPool::ParallelFor(int64_t count, const Cancellation* cancellation,
                             absl::FunctionRef<void(int64_t)> body) {
  auto loop = std::make_shared<Loop>(count, cancellation, body);
  const int64_t helpers = std::min<int64_t>(threads(), count - 1);
  for (int64_t i = 0; i < helpers; ++i) {
    Submit([loop] { loop->Run(); });
  }
  loop->Run();
  return loop->Finish();
}

void ThreadPool::Work() {
  for (;;) {
    std::function<void()> task;
    {
      MutexLock lock(mutex_);
      while (tasks_.empty() && !stopping_) wake_.Wait(mutex_);
      if (tasks_.empty()) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    task();
  }
}

bool ParallelFor(ThreadPool* pool, int64_t count,
                 const Cancellation* cancellation,
                 absl::FunctionRef<void(int64_t)> body) {
  if (pool != nullptr) return pool->ParallelFor(count, cancellation, body);
  for (int64_t i = 0; i < count; ++i) {
    if (cancellation != nullptr && cancellation->cancelled()) return false;
    body(i);
  }
  return true;
}

}  // namespace deform
