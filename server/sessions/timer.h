// Calls at given times.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <thread>

#include "core/base/mutex.h"

namespace deform::server {

// One thread that sleeps until the next call is due. Thread-safe.
class Timer {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  Timer() : thread_([this] { Work(); }) {}
  ~Timer() { Stop(); }

  // Calls `task` at `time` or soon after, on the timer's thread, where others
  // wait for it: it must not block. Nothing after Stop().
  void At(TimePoint time, std::function<void()> task);

  // Drops what is not due yet, and waits for a task that runs.
  void Stop();

 private:
  void Work();

  Mutex mutex_;
  CondVar changed_;
  std::multimap<TimePoint, std::function<void()>> tasks_
      ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // The last: it uses the others.
};

}  // namespace deform::server
