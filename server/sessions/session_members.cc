// A session and those who take part: coming, coming back, and what is checked
// of what they send.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/sessions/session.h"

namespace deform::server {

absl::StatusOr<Session::Joined> Session::Join(Delivery delivery,
                                              const FrameWishes& wishes,
                                              std::weak_ptr<Receiver> receiver,
                                              const Introduction& who) {
  if (wishes.TakesBasis()) {
    {
      MutexLock lock(mutex_);
      wants_basis_ = true;
    }
    ProvideBasis();
  }
  const auto now = environment_.clock();
  Receivers to_wake;
  const auto join = [&]() -> absl::StatusOr<Joined> {
    MutexLock lock(mutex_);
    if (closed_) return *closed_;
    DEFORM_ASSIGN_OR_RETURN(
        const Subscription wanted,
        Subscribe(delivery, wishes, facts().rig(), *facts().model()));
    DEFORM_RETURN_IF_ERROR(roster_.CheckAttempt(who, now));
    if (const auto before = roster_.SeatOf(who.token)) {
      to_wake = audience_.receivers({&*before, 1});
      Dismiss(*before);
    }
    if (audience_.size() >= environment_.max_participants) {
      return MakeError(
          absl::StatusCode::kResourceExhausted,
          absl::StrCat("the session has ", audience_.size(),
                       " participants, its limit (max-participants)"),
          {.reason = "TOO_MANY_PARTICIPANTS", .field = "max-participants"});
    }
    const int64_t seat = audience_.next_seat();
    DEFORM_ASSIGN_OR_RETURN(
        Roster::Member * member,
        roster_.Enter(seat, who, rig_history_.count(), now));
    const auto from = Welcome(*member, who);
    if (!from.ok()) {
      roster_.Leave(seat, now);
      return from.status();
    }
    audience_.Add(wanted, std::move(receiver), now, *from);
    const auto others = audience_.receivers(roster_.AwaitingPresence(now));
    to_wake.insert(to_wake.end(), others.begin(), others.end());
    Schedule();
    return Joined{.participant = std::unique_ptr<Participant>(
                      new Participant(shared_from_this(), seat, member->key)),
                  .format = wanted.format,
                  .state = StateLocked(),
                  .binding = facts(),
                  .pose = pose_,
                  .participant_id = member->id(),
                  .token = member->token,
                  .resumed = member->resumed,
                  .last_sequence = member->place.last_sequence};
  };
  auto joined = join();
  Wake(to_wake);
  return joined;
}

absl::StatusOr<Rejoining> Session::Welcome(const Roster::Member& member,
                                           const Introduction& who) const {
  Rejoining from;
  if (!member.resumed) return from;
  const uint64_t changes = RigChangesFor(member);
  const auto missed =
      rig_history_.Last(changes - std::min(changes, who.rig_changes));
  if (!missed || missed->size() > Outbox::kMaxRigChanges) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     "the rig has changed too often since this stream broke: "
                     "join as somebody new (join.resume)",
                     {.reason = "RIG_CHANGED", .field = "join.resume"});
  }
  from.last_pose = member.place.last_pose;
  from.contained = member.place.contained;
  from.revision = who.last_revision;
  from.changes = *missed;
  // What came after is sent again, and so answered again.
  for (const Notice& notice : member.place.notices) {
    const uint64_t sequence =
        std::visit([](const auto& any) { return any.sequence; }, notice);
    if (sequence > who.last_sequence &&
        sequence <= member.place.last_sequence) {
      from.notices.push_back(notice);
    }
  }
  return from;
}

void Session::Dismiss(int64_t seat) {
  roster_.Leave(seat, environment_.clock());
  audience_.Remove(seat);
  dismissed_[seat] =
      MakeError(absl::StatusCode::kAborted,
                "another stream has joined with the token of this one",
                {.reason = "TAKEN_OVER"});
}

void Session::CallWhenDue() {
  const auto due = audience_.NextDue();
  if (!due || (called_at_ && *called_at_ <= *due)) return;
  called_at_ = due;
  environment_.call_at(*due, [weak = weak_from_this(), due = *due] {
    if (const auto session = weak.lock()) session->ServeWhoIsDue(due);
  });
}

void Session::ServeWhoIsDue(Audience::TimePoint due) {
  Receivers served;
  {
    MutexLock lock(mutex_);
    if (called_at_ == due) called_at_.reset();
    served = audience_.Serve(environment_.clock());
    Schedule();
  }
  Wake(served);
}

uint64_t Session::RigChangesFor(const Roster::Member& member) const {
  return rig_history_.count() - member.place.first_change;
}

absl::StatusOr<PoseUpdate> Session::CheckPose(
    const Roster::Member& member, uint64_t sequence,
    const absl::StatusOr<PoseUpdate>& update, const PoseTerms& terms) const {
  DEFORM_RETURN_IF_ERROR(Roster::CheckSequence(member, sequence));
  if (!update.ok()) return update.status();
  const uint64_t changes = RigChangesFor(member);
  if (terms.rig_changes > changes) {
    return InvalidInput(
        "RIG_UNKNOWN", "pose.rig_changes",
        absl::StrCat("pose.rig_changes is ", terms.rig_changes,
                     ", but this stream was told of ", changes));
  }
  absl::StatusOr<PoseUpdate> present = update;
  if (terms.rig_changes < changes) {
    present = rig_history_.TakeOver(*update, changes - terms.rig_changes);
  } else if (const auto status = CheckPoseUpdate(*update, facts().rig());
             !status.ok()) {
    present = status;
  }
  if (!present.ok()) return present;
  DEFORM_RETURN_IF_ERROR(roster_.CheckWrite(
      member, *present, terms.base_revision, environment_.clock()));
  return present;
}

absl::Status Session::CheckIsOfRig(const Roster::Member& member,
                                   uint64_t rig_changes) const {
  const uint64_t changes = RigChangesFor(member);
  if (rig_changes == changes) return absl::OkStatus();
  return InvalidInput(
      "RIG_CHANGED", "rig_changes",
      absl::StrCat("this is meant for the rig after ", rig_changes,
                   " changes, but there were ", changes, ": read rig_changed"));
}

void Session::Complete(Outgoing& outgoing) const {
  auto* const rejection = std::get_if<Rejection>(&outgoing);
  if (rejection != nullptr &&
      rejection->status.code() == absl::StatusCode::kAborted) {
    const int64_t rows = PoseRows(facts().rig());
    rejection->current = {.revision = revision_,
                          .dimension = dimension_,
                          .pose = {.vertices = pose_.vertices.topRows(rows),
                                   .stretch_blend = pose_.stretch_blend}};
  }
}

void Session::Accept(Roster::Member& member, Outbox& outbox, uint64_t sequence,
                     const PoseUpdate& update, uint64_t write) {
  member.place.last_sequence = sequence;
  member.place.last_pose = sequence;
  outbox.Expect(sequence);
  queue_.Push(
      {.participant = member.id(), .sequence = sequence, .write = write},
      update, outbox.delivery() == Delivery::kEvery);
  Schedule();
}

}  // namespace deform::server
