// Who takes part in a session: what each may write, has written, locked and
// shown, and what is kept for those whose stream broke.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "core/deform/pose_transfer.h"
#include "server/sessions/handle_locks.h"
#include "server/sessions/outbox.h"
#include "server/sessions/pose_queue.h"
#include "server/sessions/presence.h"
#include "server/sessions/resumptions.h"
#include "server/sessions/write_log.h"
#include "server/stores/records.h"

namespace deform::server {

// What somebody says when joining.
struct Introduction {
  Role role = Role::kEditor;
  std::string name;
  bool wants_presence = false;  // To be told of the others.
  // Of an earlier stream, to go on where that was; empty: somebody new.
  std::string token;
  // And what came of it: the revision of the last frame, if any; the pose up to
  // which all were answered; the changes of the rig that were read.
  std::optional<uint64_t> last_revision;
  uint64_t last_sequence = 0;
  uint64_t rig_changes = 0;
  // Counts the attempts to come back with the token; 0: not counted.
  uint64_t attempt = 0;
};

// What a pose asks for beside its places.
struct PoseTerms {
  // Changes of the rig that its sender knew of.
  uint64_t rig_changes = 0;
  // The edit it is a part of; 0: it cannot be undone.
  uint64_t edit = 0;
  // Refused if others have written its vertices after this revision.
  std::optional<uint64_t> base_revision;
};

// Not thread-safe; time is passed in. A member sits in a seat of the audience,
// but keeps its id over streams.
class Roster {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  static constexpr std::chrono::milliseconds kDefaultLease{5'000};
  static constexpr std::chrono::milliseconds kMaxLease{60'000};
  static constexpr size_t kMaxLocked = 256;  // By one request.
  // Shortest time between two presence changes for one receiver.
  static constexpr std::chrono::milliseconds kPresenceInterval{50};

  struct Member {
    Role role = Role::kEditor;
    std::string token;
    std::string key;  // That follows from it.
    Place place;
    bool resumed = false;  // It is not somebody new.
    bool wants_presence = false;
    uint64_t known_presence = 0;
    std::optional<TimePoint> presence_sent;

    int64_t id() const { return place.participant; }
  };

  // Poses have `rows`. Up to `max_kept` places are kept, for `grace`.
  Roster(int64_t rows, size_t max_kept, std::chrono::milliseconds grace)
      : places_(max_kept, grace), log_(rows) {}

  // The seat of whoever has this token now.
  std::optional<int64_t> SeatOf(const std::string& token) const;
  // Aborted TAKEN_OVER: a later attempt with this token has been here.
  absl::Status CheckAttempt(const Introduction& who, TimePoint now);
  // Takes the seat, as who has the token was, or as somebody new if nobody is
  // known by it. Nobody has it now. `rig_changes`: those that there were.
  // InvalidArgument NAME_TOO_LONG; Internal.
  absl::StatusOr<Member*> Enter(int64_t seat, const Introduction& who,
                                uint64_t rig_changes, TimePoint now);
  // Its place is kept, and its locks for their lease.
  void Leave(int64_t seat, TimePoint now);
  // Who left with this key has gone for good.
  void Forget(const std::string& key, TimePoint now);
  // Null if nobody sits there.
  Member* Find(int64_t seat);
  // Seat of a member; none if it is not there.
  std::optional<int64_t> SeatOf(int64_t id) const;

  // Sequences of one member rise, over all its streams: InvalidArgument
  // SEQUENCE_NOT_RISING.
  static absl::Status CheckSequence(const Member& member, uint64_t sequence);
  // What its stream is to be told, kept in case that breaks.
  static void Remember(Member& member, Notice notice);

  // Whether `member` may write `update`, right for the present rig:
  // PermissionDenied VIEWER; FailedPrecondition HANDLE_LOCKED; Aborted
  // REVISION_CONFLICT.
  absl::Status CheckWrite(const Member& member, const PoseUpdate& update,
                          std::optional<uint64_t> base_revision,
                          TimePoint now) const;
  // It was accepted, to change `pose`. Returns the number of the write.
  uint64_t Wrote(Member& member, const PoseUpdate& update, uint64_t edit,
                 const Pose& pose);
  // What undoing or redoing would write to `pose`, checked like any write, and
  // FailedPrecondition NOTHING_TO_UNDO, NOTHING_TO_REDO, EDIT_OVERWRITTEN
  // (others have written all of it since; that edit is given up).
  absl::StatusOr<EditHistory::Reversal> Plan(Member& member,
                                             EditHistory::Direction direction,
                                             const Pose& pose, TimePoint now);
  // That was accepted. Returns the number of the write.
  uint64_t Reversed(Member& member, EditHistory::Direction direction,
                    const EditHistory::Reversal& reversal);

  // For `lease`, or the default if it is 0. PermissionDenied VIEWER;
  // InvalidArgument MISSING_FIELD, TOO_MANY_HANDLES, INDEX_OUT_OF_RANGE,
  // LEASE_TOO_LONG; FailedPrecondition HANDLE_LOCKED.
  absl::Status Lock(const Member& member, std::span<const int32_t> handles,
                    std::chrono::milliseconds lease, int64_t rows,
                    TimePoint now);
  // All that it has if `handles` is empty.
  void Unlock(const Member& member, std::span<const int32_t> handles,
              TimePoint now);

  // As Presence::Check().
  absl::Status Show(const Member& member, Shown shown, int64_t rows);
  // What `member` is to be told of others now, if it wants to know: at most one
  // change per interval, and nothing before `now` has come to that.
  std::optional<PresenceChange> TakePresence(Member& member, TimePoint now);
  uint64_t presence_version() const { return presence_.version(); }
  // Seats to which TakePresence() would give something.
  std::vector<int64_t> AwaitingPresence(TimePoint now) const;

  // The revision contains these answers of members.
  void Published(uint64_t revision,
                 const std::vector<PoseQueue::Answer>& answers);
  // The rig has changed.
  void Transfer(const PoseTransfer& transfer, TimePoint now);

  // What of all this outlives a server: of everybody, by key, the newest pose
  // that the revision contains. And back: who presents the token of such a key
  // goes on from there.
  AnsweredSequences Answers();
  void Restore(const AnsweredSequences& answers, TimePoint now);

 private:
  absl::Status CheckLocks(const Member& member, const PoseUpdate& update,
                          TimePoint now) const;
  absl::Status LockedError(const HandleLocks::Held& held, TimePoint now) const;
  bool PresenceDue(const Member& member, TimePoint now) const;

  std::map<int64_t, Member> members_;      // By seat.
  std::map<int64_t, int64_t> seats_;       // By id.
  std::map<std::string, int64_t> by_key_;  // Seats.
  int64_t next_id_ = 1;
  Resumptions places_;
  Presence presence_;
  HandleLocks locks_;
  WriteLog log_;
};

}  // namespace deform::server
