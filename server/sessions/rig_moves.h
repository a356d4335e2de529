// Sessions that are to move to another binding, and what became of them.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/mutex.h"
#include "server/sessions/rig_change.h"

namespace deform::server {

// Thread-safe. What Add() returns may be called after this object is gone.
class RigMoves {
 public:
  struct Outcome {
    std::string session_id;
    absl::StatusOr<RigMoved> moved;
  };

  // Expects one more outcome: what is returned takes it, once.
  std::function<void(const absl::StatusOr<RigMoved>&)> Add(
      const std::string& session_id);

  // True when all outcomes are there; false if `timeout` passed first.
  bool Wait(std::chrono::milliseconds timeout) const;

  // In the order of Add(); after Wait().
  std::vector<Outcome> outcomes() const;

 private:
  struct Board {
    mutable Mutex mutex;
    mutable CondVar changed;
    std::vector<Outcome> outcomes ABSL_GUARDED_BY(mutex);
    int missing ABSL_GUARDED_BY(mutex) = 0;
  };
  const std::shared_ptr<Board> board_ = std::make_shared<Board>();
};

}  // namespace deform::server
