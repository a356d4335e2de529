// Which sessions are deformed next, and which together.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <vector>

#include "core/base/mutex.h"
#include "core/base/thread_pool.h"
#include "core/weights/binding.h"

namespace deform::server {

class Session;

// Runs a task soon, on some thread; never inside the call.
using Executor = std::function<void(std::function<void()>)>;

// Sessions that wait for a step and share a binding are deformed in one pass
// over its weights. Nobody waits for others to come: who is there when a thread
// becomes free goes. Bindings take turns, and a turn is bounded: a large model
// does not starve small ones. Sessions of a binding go in the order they came.
//
// Thread-safe. Outlives its sessions and the tasks it gives to the executor.
class BatchScheduler {
 public:
  // Sessions in one pass, and the products of weights and columns in it:
  // beyond these more sessions gain little, and others would wait for long.
  static constexpr int64_t kMaxSessions = 32;
  static constexpr int64_t kMaxProducts = int64_t{1} << 29;

  struct Options {
    Executor executor;
    // Splits the work of a batch; may be null. Borrowed.
    ThreadPool* pool = nullptr;
    int concurrent = 1;  // Batches at a time.
    int64_t max_sessions = kMaxSessions;
  };

  explicit BatchScheduler(Options options) : options_(std::move(options)) {}

  // `session`, whose binding this is, has a step to run. It is not added again
  // before that has begun to end.
  void Add(std::shared_ptr<Session> session, const Binding& binding);

  // How many sessions of `binding` go in one pass: at least one.
  static int64_t SessionsPerPass(const BindingFacts& binding);

 private:
  using Sessions = std::vector<std::shared_ptr<Session>>;
  // Sessions that wait for their turn; never empty.
  struct Group {
    const Binding* binding = nullptr;
    int64_t at_once = 1;
    std::deque<std::shared_ptr<Session>> waiting;
  };

  void Start() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // One batch; then another task follows if sessions wait.
  void Work();
  Sessions Take();
  void Run(const Sessions& sessions);

  const Options options_;
  Mutex mutex_;
  std::list<Group> turns_ ABSL_GUARDED_BY(mutex_);  // Whose turn is next first.
  std::map<const Binding*, std::list<Group>::iterator> groups_
      ABSL_GUARDED_BY(mutex_);
  int running_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace deform::server
