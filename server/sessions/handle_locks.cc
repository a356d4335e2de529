#include "server/sessions/handle_locks.h"

#include <utility>

namespace deform::server {

std::optional<HandleLocks::Held> HandleLocks::Acquire(
    int64_t who, std::span<const int32_t> handles, TimePoint until,
    TimePoint now) {
  DropExpired(now);
  if (auto other = HeldByOther(who, handles, now)) return other;
  for (const int32_t handle : handles) {
    locks_[handle] = {.owner = who, .until = until};
  }
  return std::nullopt;
}

void HandleLocks::Release(int64_t who, std::span<const int32_t> handles) {
  for (const int32_t handle : handles) {
    const auto found = locks_.find(handle);
    if (found != locks_.end() && found->second.owner == who) {
      locks_.erase(found);
    }
  }
}

void HandleLocks::ReleaseAll(int64_t who) {
  std::erase_if(locks_,
                [who](const auto& lock) { return lock.second.owner == who; });
}

std::optional<HandleLocks::Held> HandleLocks::HeldByOther(
    int64_t who, std::span<const int32_t> handles, TimePoint now) const {
  if (locks_.empty()) return std::nullopt;
  for (const int32_t handle : handles) {
    const auto found = locks_.find(handle);
    if (found == locks_.end()) continue;
    const Lock& lock = found->second;
    if (lock.owner != who && now < lock.until) {
      return Held{handle, lock.owner, lock.until};
    }
  }
  return std::nullopt;
}

std::optional<HandleLocks::Held> HandleLocks::HeldByOther(int64_t who,
                                                          TimePoint now) const {
  for (const auto& [handle, lock] : locks_) {
    if (lock.owner != who && now < lock.until) {
      return Held{handle, lock.owner, lock.until};
    }
  }
  return std::nullopt;
}

std::vector<HandleLocks::Held> HandleLocks::LocksOf(int64_t who,
                                                    TimePoint now) const {
  std::vector<Held> held;
  for (const auto& [handle, lock] : locks_) {
    if (lock.owner == who && now < lock.until) {
      held.push_back({handle, lock.owner, lock.until});
    }
  }
  return held;
}

void HandleLocks::Renumber(std::span<const int32_t> previous) {
  std::map<int32_t, Lock> renumbered;
  for (size_t k = 0; k < previous.size(); ++k) {
    const auto found = locks_.find(previous[k]);
    if (found != locks_.end()) {
      renumbered.emplace(static_cast<int32_t>(k), found->second);
    }
  }
  locks_.swap(renumbered);
}

void HandleLocks::DropExpired(TimePoint now) {
  std::erase_if(locks_,
                [now](const auto& lock) { return lock.second.until <= now; });
}

}  // namespace deform::server
