// When to try again.
#pragma once

#include <algorithm>
#include <chrono>
#include <functional>
#include <optional>
#include <random>
#include <utility>

namespace deform {

// The first attempt comes at once; each further one waits twice as long, up to
// a second, by up to a quarter less, so that those who lost the same server do
// not come back together. Ends when nothing has succeeded for `patience`. Not
// thread-safe.
class Backoff {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;
  using Milliseconds = std::chrono::milliseconds;

  static constexpr Milliseconds kFirst{50};
  static constexpr Milliseconds kLongest{1000};

  Backoff(Milliseconds patience, Clock clock, uint32_t seed)
      : patience_(patience), clock_(std::move(clock)), random_(seed) {}

  // How long to wait before the next attempt; none: give up.
  std::optional<Milliseconds> Next() {
    const auto now = clock_();
    if (!since_) since_ = now;
    if (patience_.count() == 0 || now - *since_ >= patience_) {
      return std::nullopt;
    }
    const Milliseconds full = next_;
    next_ = next_.count() == 0 ? kFirst : std::min(2 * next_, kLongest);
    std::uniform_int_distribution<int64_t> less(0, full.count() / 4);
    return full - Milliseconds(less(random_));
  }

  // The next failure is a first one again.
  void Succeeded() {
    since_.reset();
    next_ = {};
  }

 private:
  const Milliseconds patience_;
  const Clock clock_;
  std::minstd_rand random_;
  std::optional<std::chrono::steady_clock::time_point> since_;
  Milliseconds next_{};
};

}  // namespace deform
