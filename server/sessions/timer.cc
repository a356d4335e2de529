#include "server/sessions/timer.h"

#include <utility>

namespace deform::server {

void Timer::At(TimePoint time, std::function<void()> task) {
  MutexLock lock(mutex_);
  if (stopping_) return;
  const auto added = tasks_.emplace(time, std::move(task));
  // Otherwise the thread wakes up before that anyway.
  if (added == tasks_.begin()) changed_.NotifyOne();
}

void Timer::Stop() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.NotifyOne();
  if (thread_.joinable()) thread_.join();
}

void Timer::Work() {
  while (true) {
    std::function<void()> task;
    {
      MutexLock lock(mutex_);
      while (!stopping_) {
        if (tasks_.empty()) {
          changed_.Wait(mutex_);
          continue;
        }
        const auto left =
            tasks_.begin()->first - std::chrono::steady_clock::now();
        if (left.count() <= 0) break;
        changed_.WaitFor(mutex_, left);
      }
      if (stopping_) return;
      task = std::move(tasks_.begin()->second);
      tasks_.erase(tasks_.begin());
    }
    task();
  }
}

}  // namespace deform::server
