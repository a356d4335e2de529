// Stops long computations.
#pragma once

#include <atomic>

namespace deform {

// Whoever computes asks between two pieces of work (a tile, some milliseconds)
// and gives up with absl::CancelledError. Thread-safe; cancelling is final.
class Cancellation {
 public:
  void Cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> cancelled_{false};
};

}  // namespace deform
