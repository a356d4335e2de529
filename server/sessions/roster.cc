#include "server/sessions/roster.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/names.h"

namespace deform::server {
namespace {

using std::chrono::milliseconds;

absl::Status CheckEditor(const Roster::Member& member) {
  if (member.role == Role::kEditor) return absl::OkStatus();
  return MakeError(absl::StatusCode::kPermissionDenied,
                   "this participant is a viewer; join with the role of an "
                   "editor to change the pose",
                   {.reason = "VIEWER", .field = "join.role"});
}

}  // namespace

std::optional<int64_t> Roster::SeatOf(const std::string& token) const {
  if (token.empty()) return std::nullopt;
  const auto found = by_key_.find(ResumeKeyOf(token));
  if (found == by_key_.end()) return std::nullopt;
  return found->second;
}

std::optional<int64_t> Roster::SeatOf(int64_t id) const {
  const auto found = seats_.find(id);
  if (found == seats_.end()) return std::nullopt;
  return found->second;
}

absl::Status Roster::CheckAttempt(const Introduction& who, TimePoint now) {
  if (who.token.empty() || who.attempt == 0) return absl::OkStatus();
  const std::string key = ResumeKeyOf(who.token);
  const auto seat = by_key_.find(key);
  const Place* const place = seat != by_key_.end()
                                 ? &members_[seat->second].place
                                 : places_.Find(key, now);
  if (place == nullptr || place->attempt <= who.attempt) {
    return absl::OkStatus();
  }
  return MakeError(absl::StatusCode::kAborted,
                   absl::StrCat("attempt ", who.attempt,
                                " to come back was overtaken by attempt ",
                                place->attempt, " (join.resume)"),
                   {.reason = "TAKEN_OVER", .field = "join.resume"});
}

absl::StatusOr<Roster::Member*> Roster::Enter(int64_t seat,
                                              const Introduction& who,
                                              uint64_t rig_changes,
                                              TimePoint now) {
  DEFORM_RETURN_IF_ERROR(Presence::CheckName(who.name));
  Member member{.role = who.role, .wants_presence = who.wants_presence};
  std::optional<Place> place;
  if (!who.token.empty()) place = places_.Take(ResumeKeyOf(who.token), now);
  if (place) {
    member.token = who.token;
    member.place = *std::move(place);
    member.resumed = true;
  } else {
    DEFORM_ASSIGN_OR_RETURN(member.token, MakeResumeToken());
    member.place = {.participant = next_id_++, .first_change = rig_changes};
  }
  member.place.attempt = who.attempt;
  member.key = ResumeKeyOf(member.token);
  presence_.Enter({.id = member.id(),
                   .name = who.name,
                   .role = who.role,
                   .locks = locks_.LocksOf(member.id(), now)});
  by_key_[member.key] = seat;
  seats_[member.id()] = seat;
  return &(members_[seat] = std::move(member));
}

void Roster::Leave(int64_t seat, TimePoint now) {
  const auto found = members_.find(seat);
  if (found == members_.end()) return;
  Member& member = found->second;
  presence_.Leave(member.id());
  seats_.erase(member.id());
  by_key_.erase(member.key);
  places_.Keep(member.key, std::move(member.place), now);
  members_.erase(found);
}

void Roster::Forget(const std::string& key, TimePoint now) {
  if (const auto place = places_.Take(key, now)) {
    locks_.ReleaseAll(place->participant);
  }
}

Roster::Member* Roster::Find(int64_t seat) {
  const auto found = members_.find(seat);
  return found == members_.end() ? nullptr : &found->second;
}

absl::Status Roster::CheckSequence(const Member& member, uint64_t sequence) {
  if (sequence > member.place.last_sequence) return absl::OkStatus();
  return InvalidInput(
      "SEQUENCE_NOT_RISING", "pose.sequence",
      absl::StrCat("pose ", sequence, " comes after pose ",
                   member.place.last_sequence, "; sequences rise from 1"));
}

void Roster::Remember(Member& member, Notice notice) {
  auto& notices = member.place.notices;
  notices.push_back(std::move(notice));
  if (notices.size() > Outbox::kMaxNotices) notices.pop_front();
}

absl::Status Roster::CheckWrite(const Member& member, const PoseUpdate& update,
                                std::optional<uint64_t> base_revision,
                                TimePoint now) const {
  DEFORM_RETURN_IF_ERROR(CheckEditor(member));
  DEFORM_RETURN_IF_ERROR(CheckLocks(member, update, now));
  if (!base_revision) return absl::OkStatus();
  const auto conflict = log_.Conflict(member.id(), update, *base_revision);
  if (!conflict) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kAborted,
      absl::StrCat(
          *conflict < 0 ? "the stretch blend"
                        : absl::StrCat("vertex ", *conflict),
          " was written by another participant after revision ", *base_revision,
          " (pose.base_revision): merge with the current pose, and send again"),
      {.reason = "REVISION_CONFLICT", .field = "pose.base_revision"});
}

absl::Status Roster::CheckLocks(const Member& member, const PoseUpdate& update,
                                TimePoint now) const {
  std::optional<HandleLocks::Held> held;
  if (!update.vertices.empty()) {
    held = locks_.HeldByOther(member.id(), update.vertices, now);
  } else if (update.positions.rows() > 0) {
    held = locks_.HeldByOther(member.id(), now);
  }
  return held ? LockedError(*held, now) : absl::OkStatus();
}

absl::Status Roster::LockedError(const HandleLocks::Held& held,
                                 TimePoint now) const {
  std::string owner = absl::StrCat("participant ", held.owner);
  const Attendee* attendee = presence_.Find(held.owner);
  if (attendee != nullptr && !attendee->name.empty()) {
    absl::StrAppend(&owner, " (", Quoted(attendee->name), ")");
  }
  const std::chrono::duration<double> left = held.until - now;
  return MakeError(
      absl::StatusCode::kFailedPrecondition,
      absl::StrFormat("handle %d is locked by %s for %.1f s more: wait, or "
                      "leave it out",
                      held.handle, owner, left.count()),
      {.reason = "HANDLE_LOCKED",
       .resource_type = "handle",
       .resource_name = absl::StrCat(held.handle)});
}

uint64_t Roster::Wrote(Member& member, const PoseUpdate& update, uint64_t edit,
                       const Pose& pose) {
  if (edit != 0) member.place.history.Record(edit, update, pose);
  return log_.Wrote(member.id(), update);
}

absl::StatusOr<EditHistory::Reversal> Roster::Plan(
    Member& member, EditHistory::Direction direction, const Pose& pose,
    TimePoint now) {
  const bool undo = direction == EditHistory::Direction::kUndo;
  DEFORM_RETURN_IF_ERROR(CheckEditor(member));
  auto reversal = member.place.history.Plan(direction, pose);
  if (!reversal) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition,
        undo ? "this participant has no edit to undo; poses are edits if they "
               "name one (pose.edit)"
             : "this participant has undone nothing since its last edit",
        {.reason = undo ? "NOTHING_TO_UNDO" : "NOTHING_TO_REDO"});
  }
  if (reversal->nothing()) {
    member.place.history.Advance(direction);
    return MakeError(
        absl::StatusCode::kFailedPrecondition,
        absl::StrCat("nothing is left of edit ", reversal->edit, " to ",
                     undo ? "undo" : "redo",
                     ": others have written all of it since; the next is next"),
        {.reason = "EDIT_OVERWRITTEN"});
  }
  DEFORM_RETURN_IF_ERROR(
      CheckWrite(member, reversal->update, std::nullopt, now));
  return *std::move(reversal);
}

uint64_t Roster::Reversed(Member& member, EditHistory::Direction direction,
                          const EditHistory::Reversal& reversal) {
  member.place.history.Advance(direction);
  return log_.Wrote(member.id(), reversal.update);
}

absl::Status Roster::Lock(const Member& member,
                          std::span<const int32_t> handles, milliseconds lease,
                          int64_t rows, TimePoint now) {
  DEFORM_RETURN_IF_ERROR(CheckEditor(member));
  if (handles.empty()) {
    return InvalidInput("MISSING_FIELD", "lock.vertices",
                        "name the handles that are to be locked");
  }
  if (handles.size() > kMaxLocked) {
    return InvalidInput("TOO_MANY_HANDLES", "lock.vertices",
                        absl::StrCat("lock names ", handles.size(),
                                     " handles; at most ", kMaxLocked));
  }
  for (const int32_t handle : handles) {
    if (handle >= 0 && handle < rows) continue;
    return InvalidInput(
        "INDEX_OUT_OF_RANGE", "lock.vertices",
        absl::StrCat("lock refers to vertex ", handle, " of ", rows));
  }
  if (lease > kMaxLease) {
    return InvalidInput(
        "LEASE_TOO_LONG", "lock.lease_ms",
        absl::StrCat("a lease of ", lease.count(), " ms; at most ",
                     kMaxLease.count(), ": lock again before it ends"));
  }
  const milliseconds time = lease.count() == 0 ? kDefaultLease : lease;
  if (const auto held = locks_.Acquire(member.id(), handles, now + time, now)) {
    return LockedError(*held, now);
  }
  presence_.SetLocks(member.id(), locks_.LocksOf(member.id(), now));
  return absl::OkStatus();
}

void Roster::Unlock(const Member& member, std::span<const int32_t> handles,
                    TimePoint now) {
  if (handles.empty()) {
    locks_.ReleaseAll(member.id());
  } else {
    locks_.Release(member.id(), handles);
  }
  presence_.SetLocks(member.id(), locks_.LocksOf(member.id(), now));
}

absl::Status Roster::Show(const Member& member, Shown shown, int64_t rows) {
  DEFORM_RETURN_IF_ERROR(Presence::Check(shown, rows));
  presence_.Show(member.id(), std::move(shown));
  return absl::OkStatus();
}

bool Roster::PresenceDue(const Member& member, TimePoint now) const {
  return member.wants_presence && member.known_presence < presence_.version() &&
         (!member.presence_sent ||
          now - *member.presence_sent >= kPresenceInterval);
}

std::optional<PresenceChange> Roster::TakePresence(Member& member,
                                                   TimePoint now) {
  if (!PresenceDue(member, now)) return std::nullopt;
  PresenceChange change = presence_.Since(member.known_presence);
  member.known_presence = change.version;
  member.presence_sent = now;
  return change;
}

std::vector<int64_t> Roster::AwaitingPresence(TimePoint now) const {
  std::vector<int64_t> seats;
  for (const auto& [seat, member] : members_) {
    if (PresenceDue(member, now)) seats.push_back(seat);
  }
  return seats;
}

void Roster::Published(uint64_t revision,
                       const std::vector<PoseQueue::Answer>& answers) {
  uint64_t writes = 0;
  for (const PoseQueue::Answer& answer : answers) {
    writes = std::max(writes, answer.write);
    const auto seat = SeatOf(answer.participant);
    Place* const place =
        seat ? &members_[*seat].place : places_.Find(answer.participant);
    if (place != nullptr) place->contained = answer.sequence;
  }
  if (writes > 0) log_.Published(revision, writes);
}

void Roster::Transfer(const PoseTransfer& transfer, TimePoint now) {
  locks_.Renumber(transfer.previous());
  presence_.Renumber(transfer.previous());
  log_.Renumber(transfer.previous());
  for (auto& [seat, member] : members_) {
    member.place.history.Transfer(transfer);
    presence_.SetLocks(member.id(), locks_.LocksOf(member.id(), now));
  }
  places_.ForEach([&](const std::string& /*key*/, Place& place) {
    place.history.Transfer(transfer);
  });
}

AnsweredSequences Roster::Answers() {
  AnsweredSequences answers;
  const auto add = [&answers](const std::string& key, const Place& place) {
    if (place.contained > 0) answers[key] = place.contained;
  };
  for (const auto& [seat, member] : members_) add(member.key, member.place);
  places_.ForEach(add);
  return answers;
}

void Roster::Restore(const AnsweredSequences& answers, TimePoint now) {
  for (const auto& [key, sequence] : answers) {
    places_.Keep(key,
                 {.participant = next_id_++,
                  .last_sequence = sequence,
                  .last_pose = sequence,
                  .contained = sequence},
                 now);
  }
}

}  // namespace deform::server
