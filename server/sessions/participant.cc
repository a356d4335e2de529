#include "server/sessions/participant.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/sessions/session.h"

namespace deform::server {

Participant::~Participant() { Leave(); }

bool Participant::Request(
    uint64_t sequence,
    absl::FunctionRef<absl::Status(Roster::Member&, Outbox&)> carry_out) {
  Session& session = *session_;
  Session::Receivers to_wake;
  bool accepted = false;
  {
    MutexLock lock(session.mutex_);
    Outbox* const outbox = session.audience_.Find(seat_);
    if (outbox == nullptr || session.closed_) return false;
    Roster& roster = session.roster_;
    Roster::Member& member = *roster.Find(seat_);
    const uint64_t shown = roster.presence_version();
    const absl::Status status = carry_out(member, *outbox);
    accepted = status.ok();
    if (!accepted) {
      outbox->Reject(sequence, status);
      Roster::Remember(member, Rejection{sequence, status, std::nullopt});
    }
    if (roster.presence_version() != shown) {
      to_wake = session.audience_.receivers(
          roster.AwaitingPresence(session.environment_.clock()));
    }
  }
  Session::Wake(to_wake);
  return accepted;
}

bool Participant::Submit(uint64_t sequence,
                         const absl::StatusOr<PoseUpdate>& update,
                         const PoseTerms& terms) {
  Session& session = *session_;
  const auto submit =
      [&](Roster::Member& member, Outbox& outbox)
          ABSL_EXCLUSIVE_LOCKS_REQUIRED(session.mutex_) -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const PoseUpdate present,
                            session.CheckPose(member, sequence, update, terms));
    const uint64_t write = session.roster_.Wrote(member, present, terms.edit,
                                                 session.queue_.newest());
    session.Accept(member, outbox, sequence, present, write);
    return absl::OkStatus();
  };
  return Request(sequence, submit);
}

bool Participant::Reverse(uint64_t sequence, EditHistory::Direction direction) {
  Session& session = *session_;
  const auto reverse =
      [&](Roster::Member& member, Outbox& outbox)
          ABSL_EXCLUSIVE_LOCKS_REQUIRED(session.mutex_) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(Roster::CheckSequence(member, sequence));
    DEFORM_ASSIGN_OR_RETURN(
        EditHistory::Reversal reversal,
        session.roster_.Plan(member, direction, session.queue_.newest(),
                             session.environment_.clock()));
    const uint64_t write =
        session.roster_.Reversed(member, direction, reversal);
    session.Accept(member, outbox, sequence, reversal.update, write);
    Acknowledge(member, outbox,
                {.sequence = sequence,
                 .edit = reversal.edit,
                 .left_out = std::move(reversal.left_out)});
    return absl::OkStatus();
  };
  return Request(sequence, reverse);
}

bool Participant::Lock(uint64_t sequence,
                       const absl::StatusOr<std::vector<int32_t>>& handles,
                       std::chrono::milliseconds lease, uint64_t rig_changes) {
  Session& session = *session_;
  const auto lock =
      [&](Roster::Member& member, Outbox& outbox)
          ABSL_EXCLUSIVE_LOCKS_REQUIRED(session.mutex_) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(Roster::CheckSequence(member, sequence));
    DEFORM_RETURN_IF_ERROR(handles.status());
    DEFORM_RETURN_IF_ERROR(session.CheckIsOfRig(member, rig_changes));
    DEFORM_RETURN_IF_ERROR(session.roster_.Lock(member, *handles, lease,
                                                PoseRows(session.facts().rig()),
                                                session.environment_.clock()));
    Acknowledge(member, outbox, {.sequence = sequence});
    return absl::OkStatus();
  };
  return Request(sequence, lock);
}

bool Participant::Unlock(uint64_t sequence,
                         const absl::StatusOr<std::vector<int32_t>>& handles,
                         uint64_t rig_changes) {
  Session& session = *session_;
  const auto unlock =
      [&](Roster::Member& member, Outbox& outbox)
          ABSL_EXCLUSIVE_LOCKS_REQUIRED(session.mutex_) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(Roster::CheckSequence(member, sequence));
    DEFORM_RETURN_IF_ERROR(handles.status());
    DEFORM_RETURN_IF_ERROR(session.CheckIsOfRig(member, rig_changes));
    session.roster_.Unlock(member, *handles, session.environment_.clock());
    Acknowledge(member, outbox, {.sequence = sequence});
    return absl::OkStatus();
  };
  return Request(sequence, unlock);
}

void Participant::Show(const absl::StatusOr<Shown>& shown) {
  Session& session = *session_;
  const auto show =
      [&](Roster::Member& member, Outbox& /*outbox*/)
          ABSL_EXCLUSIVE_LOCKS_REQUIRED(session.mutex_) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(shown.status());
    return session.roster_.Show(member, *shown,
                                PoseRows(session.facts().rig()));
  };
  Request(0, show);
}

void Participant::Acknowledge(Roster::Member& member, Outbox& outbox,
                              Acknowledgement acknowledgement) {
  member.place.last_sequence = acknowledgement.sequence;
  outbox.Notify(acknowledgement);
  Roster::Remember(member, std::move(acknowledgement));
}

bool Participant::WantsPoses() const {
  MutexLock lock(session_->mutex_);
  const Outbox* const outbox = session_->audience_.Find(seat_);
  if (outbox == nullptr || session_->closed_) return false;
  return outbox->has_room_for_notices() &&
         (outbox->delivery() != Delivery::kEvery ||
          session_->queue_.OwnStepsOf(session_->roster_.Find(seat_)->id()) <
              Session::kMaxOwnSteps);
}

void Participant::WantKeyframe() {
  MutexLock lock(session_->mutex_);
  session_->audience_.WantKeyframe(seat_);
  session_->Schedule();
}

void Participant::Hold(WeightsId weights) {
  MutexLock lock(session_->mutex_);
  session_->audience_.Hold(seat_, std::move(weights));
}

void Participant::HalfClose() {
  MutexLock lock(session_->mutex_);
  Outbox* const outbox = session_->audience_.Find(seat_);
  if (outbox == nullptr) return;
  outbox->EndWhenAnswered(absl::OkStatus());
  session_->Schedule();  // Its last frame does not wait for time to pass.
}

std::optional<Outgoing> Participant::Take() {
  Session& session = *session_;
  const auto now = session.environment_.clock();
  MutexLock lock(session.mutex_);
  const auto dismissed = session.dismissed_.find(seat_);
  if (dismissed != session.dismissed_.end()) return Ended{dismissed->second};
  Roster::Member* const member = session.roster_.Find(seat_);
  if (member == nullptr) return std::nullopt;
  if (auto change = session.roster_.TakePresence(*member, now)) {
    session.audience_.Progressed(seat_, now);
    return *std::move(change);
  }
  std::optional<Outgoing> next = session.audience_.Take(seat_, now);
  if (next) session.Complete(*next);
  session.Schedule();
  return next;
}

void Participant::Progressed() {
  MutexLock lock(session_->mutex_);
  session_->audience_.Progressed(seat_, session_->environment_.clock());
}

absl::Status Participant::CheckStall() const {
  const SessionEnvironment& environment = session_->environment_;
  const auto now = environment.clock();
  MutexLock lock(session_->mutex_);
  const auto dismissed = session_->dismissed_.find(seat_);
  if (dismissed != session_->dismissed_.end()) return dismissed->second;
  const auto since = session_->audience_.WaitingSince(seat_);
  if (!since || now - *since <= environment.stall_timeout) {
    return absl::OkStatus();
  }
  return MakeError(
      absl::StatusCode::kAborted,
      absl::StrCat("the stream took no message for ",
                   environment.stall_timeout.count() / 1000.0,
                   " s (stall-timeout): read faster, or join again"),
      {.reason = "RECEIVER_STALLED", .field = "stall-timeout"});
}

void Participant::Leave() {
  MutexLock lock(session_->mutex_);
  session_->roster_.Leave(seat_, session_->environment_.clock());
  session_->audience_.Remove(seat_);
  session_->dismissed_.erase(seat_);
  session_->Schedule();
}

void Participant::Forget() {
  MutexLock lock(session_->mutex_);
  session_->roster_.Forget(key_, session_->environment_.clock());
}

}  // namespace deform::server
