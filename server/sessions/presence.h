// Who takes part in a session, and what they show each other.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "server/sessions/handle_locks.h"

namespace deform::server {

enum class Role {
  kEditor,  // Sends poses.
  kViewer,  // Only receives frames.
};

// What a participant says of itself, to be shown to others.
struct Shown {
  std::vector<int32_t> grabbed;  // Handles that it is moving.
  std::string cursor;            // Bytes that only clients understand.
};

struct Attendee {
  int64_t id = 0;
  std::string name;
  Role role = Role::kEditor;
  Shown shown;
  std::vector<HandleLocks::Held> locks;
};

// What has changed for somebody who knew less.
struct PresenceChange {
  uint64_t version = 0;  // What is known after it.
  // `present` are all there are; who is not among them has left.
  bool complete = false;
  std::vector<Attendee> present;  // New or changed, by id.
  std::vector<int64_t> left;
};

// Every change raises the version; a receiver is told all changes since the
// version it knows, in one piece. So one who reads slowly costs a number, not a
// queue. Not thread-safe.
class Presence {
 public:
  // Who comes when so many are shown is not shown.
  static constexpr size_t kMaxAttendees = 256;
  static constexpr size_t kMaxCursorBytes = 256;
  static constexpr size_t kMaxGrabbed = 256;
  static constexpr size_t kMaxNameBytes = 64;
  // Who left is remembered for those who were not told yet, so far back;
  // farther behind, one is told all anew.
  static constexpr size_t kMaxLeft = 64;

  // InvalidArgument NAME_TOO_LONG.
  static absl::Status CheckName(const std::string& name);
  // InvalidArgument CURSOR_TOO_LARGE, TOO_MANY_HANDLES, INDEX_OUT_OF_RANGE;
  // `rows` are those of a pose.
  static absl::Status Check(const Shown& shown, int64_t rows);

  // A new id.
  void Enter(Attendee attendee);
  void Leave(int64_t id);
  // These do nothing if nothing changes.
  void Show(int64_t id, Shown shown);
  void SetLocks(int64_t id, std::vector<HandleLocks::Held> locks);
  // The rig has changed, as in HandleLocks.
  void Renumber(const std::vector<int32_t>& previous);

  // Of the last change; 0 before the first.
  uint64_t version() const { return version_; }
  // What has changed since then; everything for version 0.
  PresenceChange Since(uint64_t version) const;

  // Null if there is none.
  const Attendee* Find(int64_t id) const;

 private:
  struct Entry {
    Attendee attendee;
    uint64_t changed = 0;  // The version.
  };

  std::map<int64_t, Entry> entries_;
  // Version and id, oldest first.
  std::deque<std::pair<uint64_t, int64_t>> left_;
  uint64_t forgotten_ = 0;  // Who left up to this version is not in left_.
  uint64_t version_ = 0;
};

}  // namespace deform::server
