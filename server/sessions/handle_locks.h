// Who alone may move which handles, for a while.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

namespace deform::server {

// Locks are soft: each ends with its lease, unless its owner takes it again
// before. Handles are rows of a pose, which the caller has checked: there are
// at most as many locks. Not thread-safe; time is passed in.
class HandleLocks {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Held {
    int32_t handle = 0;
    int64_t owner = 0;
    TimePoint until;
    bool operator==(const Held&) const = default;
  };

  // Locks `handles` until then, or extends what `who` has. If another holds one
  // of them, nothing changes, and the first such is returned.
  std::optional<Held> Acquire(int64_t who, std::span<const int32_t> handles,
                              TimePoint until, TimePoint now);
  // What `who` does not hold stays as it is.
  void Release(int64_t who, std::span<const int32_t> handles);
  void ReleaseAll(int64_t who);

  // The first of `handles`, or of all, that another than `who` holds.
  std::optional<Held> HeldByOther(int64_t who, std::span<const int32_t> handles,
                                  TimePoint now) const;
  std::optional<Held> HeldByOther(int64_t who, TimePoint now) const;

  // In the order of handles.
  std::vector<Held> LocksOf(int64_t who, TimePoint now) const;

  // The rig has changed: `previous` tells of each handle which one it was
  // before, or -1. Locks follow their handles.
  void Renumber(std::span<const int32_t> previous);

 private:
  struct Lock {
    int64_t owner = 0;
    TimePoint until;
  };

  void DropExpired(TimePoint now);

  std::map<int32_t, Lock> locks_;  // By handle.
};

}  // namespace deform::server
