// Memory that clients can make the server use, kept below a limit.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/mutex.h"

namespace deform::server {

// "1.5 GiB".
std::string FormatBytes(int64_t bytes);

// Thread-safe. Outlives its reservations.
class MemoryBudget {
 public:
  // Gives its bytes back when it goes. Movable; an empty one holds nothing.
  class Reservation {
   public:
    Reservation() = default;
    Reservation(Reservation&& other) noexcept
        : budget_(std::exchange(other.budget_, nullptr)),
          bytes_(std::exchange(other.bytes_, 0)) {}
    Reservation& operator=(Reservation&& other) noexcept {
      std::swap(budget_, other.budget_);
      std::swap(bytes_, other.bytes_);
      return *this;
    }
    ~Reservation();

    int64_t bytes() const { return bytes_; }

    // Holds `bytes` from now on: fewer always, more as Reserve() would. An
    // empty one stays empty.
    absl::Status Resize(int64_t bytes, absl::string_view what);
    // A part of its own, at most all; this one holds the rest.
    Reservation Split(int64_t bytes);

   private:
    friend class MemoryBudget;
    Reservation(MemoryBudget* budget, int64_t bytes)
        : budget_(budget), bytes_(bytes) {}

    MemoryBudget* budget_ = nullptr;
    int64_t bytes_ = 0;
  };

  // Makes reservations that nobody needs go, at least so many bytes; none if
  // there are not that many. Returns how many there were. Called without a
  // lock held.
  using Reclaim = std::function<int64_t(int64_t missing)>;

  // `option` is the name of the setting that an operator would raise.
  MemoryBudget(int64_t limit, absl::string_view option, Reclaim reclaim = {})
      : limit_(limit), option_(option), reclaim_(std::move(reclaim)) {}

  // ResourceExhausted MEMORY_LIMIT with figures, about the field `option`.
  // `what` begins the message: "weights need 2 GiB; ...". Trying again may help
  // if it would fit into an empty budget.
  absl::StatusOr<Reservation> Reserve(int64_t bytes, absl::string_view what);

  int64_t limit() const { return limit_; }
  int64_t used();

 private:
  absl::Status Take(int64_t bytes, absl::string_view what);
  // The bytes that are missing; 0: they were there and are taken.
  int64_t TryTake(int64_t bytes);
  void Release(int64_t bytes);

  const int64_t limit_;
  const std::string option_;
  const Reclaim reclaim_;
  Mutex mutex_;
  int64_t used_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace deform::server
