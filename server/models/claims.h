// Who changes something that is kept in two places, in memory and in the store.
#pragma once

#include <set>
#include <string>
#include <utility>

#include "core/base/mutex.h"

namespace deform::server {

// One at a time for each name; others wait, for a disk at most. So a thing is
// never put by one while it is removed by another, in one place only.
// Thread-safe; outlives its claims.
class Claims {
 public:
  class Claim {
   public:
    Claim(Claim&& other) noexcept
        : claims_(std::exchange(other.claims_, nullptr)),
          key_(std::move(other.key_)) {}
    Claim& operator=(Claim&&) = delete;
    ~Claim() {
      if (claims_ != nullptr) claims_->Release(key_);
    }

   private:
    friend class Claims;
    using Key = std::pair<std::string, std::string>;
    Claim(Claims* claims, Key key) : claims_(claims), key_(std::move(key)) {}
    Claims* claims_;
    Key key_;
  };

  [[nodiscard]] Claim Take(const std::string& tenant, const std::string& id) {
    const Claim::Key key(tenant, id);
    MutexLock lock(mutex_);
    while (!taken_.insert(key).second) changed_.Wait(mutex_);
    return Claim(this, key);
  }

 private:
  void Release(const Claim::Key& key) {
    MutexLock lock(mutex_);
    taken_.erase(key);
    changed_.NotifyAll();
  }

  Mutex mutex_;
  CondVar changed_;
  std::set<Claim::Key> taken_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform::server
