#include "server/sessions/presence.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform::server {

absl::Status Presence::CheckName(const std::string& name) {
  if (name.size() <= kMaxNameBytes) return absl::OkStatus();
  return InvalidInput("NAME_TOO_LONG", "name",
                      absl::StrCat("a participant's name has ", name.size(),
                                   " bytes; at most ", kMaxNameBytes));
}

absl::Status Presence::Check(const Shown& shown, int64_t rows) {
  if (shown.cursor.size() > kMaxCursorBytes) {
    return InvalidInput("CURSOR_TOO_LARGE", "presence.cursor",
                        absl::StrCat("a cursor of ", shown.cursor.size(),
                                     " bytes; at most ", kMaxCursorBytes));
  }
  if (shown.grabbed.size() > kMaxGrabbed) {
    return InvalidInput(
        "TOO_MANY_HANDLES", "presence.grabbed",
        absl::StrCat("presence names ", shown.grabbed.size(),
                     " grabbed handles; at most ", kMaxGrabbed));
  }
  for (const int32_t handle : shown.grabbed) {
    if (handle >= 0 && handle < rows) continue;
    return InvalidInput(
        "INDEX_OUT_OF_RANGE", "presence.grabbed",
        absl::StrCat("presence refers to vertex ", handle, " of ", rows));
  }
  return absl::OkStatus();
}

void Presence::Enter(Attendee attendee) {
  if (entries_.size() >= kMaxAttendees) return;
  const int64_t id = attendee.id;
  entries_[id] = {.attendee = std::move(attendee), .changed = ++version_};
}

void Presence::Leave(int64_t id) {
  if (entries_.erase(id) == 0) return;
  left_.emplace_back(++version_, id);
  if (left_.size() > kMaxLeft) {
    forgotten_ = left_.front().first;
    left_.pop_front();
  }
}

void Presence::Show(int64_t id, Shown shown) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  Shown& known = found->second.attendee.shown;
  if (known.grabbed == shown.grabbed && known.cursor == shown.cursor) return;
  known = std::move(shown);
  found->second.changed = ++version_;
}

void Presence::SetLocks(int64_t id, std::vector<HandleLocks::Held> locks) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  if (found->second.attendee.locks == locks) return;
  found->second.attendee.locks = std::move(locks);
  found->second.changed = ++version_;
}

void Presence::Renumber(const std::vector<int32_t>& previous) {
  std::map<int32_t, int32_t> now;
  for (size_t k = 0; k < previous.size(); ++k) {
    if (previous[k] >= 0) now[previous[k]] = static_cast<int32_t>(k);
  }
  for (auto& [id, entry] : entries_) {
    std::vector<int32_t> grabbed;
    for (const int32_t handle : entry.attendee.shown.grabbed) {
      const auto found = now.find(handle);
      if (found != now.end()) grabbed.push_back(found->second);
    }
    Show(id, {std::move(grabbed), entry.attendee.shown.cursor});
  }
}

PresenceChange Presence::Since(uint64_t version) const {
  PresenceChange change{.version = version_};
  change.complete = version == 0 || version < forgotten_;
  for (const auto& [id, entry] : entries_) {
    if (change.complete || entry.changed > version) {
      change.present.push_back(entry.attendee);
    }
  }
  if (change.complete) return change;
  for (const auto& [when, id] : left_) {
    // Who has come back is present.
    if (when > version && !entries_.contains(id)) change.left.push_back(id);
  }
  return change;
}

const Attendee* Presence::Find(int64_t id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second.attendee;
}

}  // namespace deform::server
