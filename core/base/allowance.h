// Bytes that several users share, for what they can also do without.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>

namespace deform {

// Thread-safe. Outlives its users.
class Allowance {
 public:
  explicit Allowance(int64_t limit) : limit_(limit) {}
  Allowance(const Allowance&) = delete;
  Allowance& operator=(const Allowance&) = delete;

  // All or nothing; true: until they are given back.
  bool Take(int64_t bytes) {
    if (used_.fetch_add(bytes) + bytes <= limit_) return true;
    used_.fetch_sub(bytes);
    return false;
  }
  void Give(int64_t bytes) { used_.fetch_sub(bytes); }

  int64_t limit() const { return limit_; }
  int64_t used() const { return used_; }

 private:
  const int64_t limit_;
  std::atomic<int64_t> used_ = 0;
};

// Of a program that watches its memory by other means.
inline Allowance& Unlimited() {
  static Allowance allowance(std::numeric_limits<int64_t>::max() / 2);
  return allowance;
}

}  // namespace deform
