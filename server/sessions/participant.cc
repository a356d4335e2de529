#include "server/sessions/participant.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "server/sessions/session.h"

namespace deform::server {

Participant::~Participant() { Leave(); }

bool Participant::Submit(uint64_t sequence,
                         const absl::StatusOr<PoseUpdate>& update,
                         uint64_t rig_changes) {
  Session& session = *session_;
  MutexLock lock(session.mutex_);
  Outbox* const outbox = session.audience_.Find(seat_);
  if (outbox == nullptr || session.closed_) return false;
  Session::Sender& sender = session.senders_[seat_];
  const absl::StatusOr<PoseUpdate> checked =
      session.CheckPose(sender, sequence, update, rig_changes);
  if (!checked.ok()) {
    outbox->Reject(sequence, checked.status());
    return false;
  }
  sender.last_sequence = sequence;
  outbox->Expect(sequence);
  session.queue_.Push({.participant = seat_, .sequence = sequence}, *checked,
                      outbox->delivery() == Delivery::kEvery);
  session.Schedule();
  return true;
}

bool Participant::WantsPoses() const {
  MutexLock lock(session_->mutex_);
  const Outbox* const outbox = session_->audience_.Find(seat_);
  if (outbox == nullptr || session_->closed_) return false;
  return outbox->has_room_for_rejections() &&
         (outbox->delivery() != Delivery::kEvery ||
          session_->queue_.OwnStepsOf(seat_) < Session::kMaxOwnSteps);
}

void Participant::WantKeyframe() {
  MutexLock lock(session_->mutex_);
  session_->audience_.WantKeyframe(seat_);
  session_->Schedule();
}

void Participant::HalfClose() {
  MutexLock lock(session_->mutex_);
  Outbox* const outbox = session_->audience_.Find(seat_);
  if (outbox != nullptr) outbox->EndWhenAnswered(absl::OkStatus());
}

std::optional<Outgoing> Participant::Take() {
  MutexLock lock(session_->mutex_);
  std::optional<Outgoing> next =
      session_->audience_.Take(seat_, session_->environment_.clock());
  session_->Schedule();
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
  session_->audience_.Remove(seat_);
  session_->senders_.erase(seat_);
  session_->Schedule();
}

}  // namespace deform::server
