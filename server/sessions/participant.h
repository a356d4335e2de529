// A place in a session, as the stream that took it sees it.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "server/sessions/outbox.h"
#include "server/sessions/roster.h"

namespace deform::server {

class Session;

// Leaves when it goes. Thread-safe.
//
// Each request has a sequence; they rise. What is refused comes as a Rejection,
// at first InvalidArgument SEQUENCE_NOT_RISING. Requests need WantsPoses().
// True if one was accepted.
class Participant {
 public:
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  const Session& session() const { return *session_; }

  // Answered by a frame. What is meant for an older rig than the present one is
  // taken over (PoseTransfer). Rejected are, beside an `update` that is a
  // status, what CheckPoseUpdate(), PoseTransfer and Roster::CheckWrite()
  // refuse and InvalidArgument RIG_CHANGED (too often), RIG_UNKNOWN (not yet so
  // often).
  bool Submit(uint64_t sequence, const absl::StatusOr<PoseUpdate>& update,
              const PoseTerms& terms = {});
  // Answered by a frame and an Acknowledgement. Rejected is what Roster::Plan()
  // refuses.
  bool Reverse(uint64_t sequence, EditHistory::Direction direction);
  // Answered by an Acknowledgement; as Roster says, for the present rig:
  // InvalidArgument RIG_CHANGED.
  bool Lock(uint64_t sequence,
            const absl::StatusOr<std::vector<int32_t>>& handles,
            std::chrono::milliseconds lease, uint64_t rig_changes);
  bool Unlock(uint64_t sequence,
              const absl::StatusOr<std::vector<int32_t>>& handles,
              uint64_t rig_changes);
  // Not answered, and has no sequence: a rejection has 0. As Roster says.
  void Show(const absl::StatusOr<Shown>& shown);

  // False while as many of its poses or notices wait as may. The receiver is
  // woken when that changes.
  bool WantsPoses() const;
  // What it held is lost: the next frame is to refer to no other.
  void WantKeyframe();
  // It has these weights from now on.
  void Hold(WeightsId weights);
  // No more poses come; the stream ends OK once those that came are answered.
  void HalfClose();

  // The next to be sent; what was taken before has been sent. Nothing: the
  // receiver will be woken, but if others have only shown something, perhaps
  // not: ask a few times a second.
  std::optional<Outgoing> Take();
  // Part of what was taken has been sent.
  void Progressed();
  // Aborted RECEIVER_STALLED if the same message has been under way for longer
  // than the stall timeout, TAKEN_OVER if another has the place: then it is to
  // leave.
  absl::Status CheckStall() const;
  // Gives up the seat. Others no longer wait for it; its place is kept for who
  // comes back with the token.
  void Leave();
  // After that: nobody will come back.
  void Forget();

 private:
  friend class Session;
  Participant(std::shared_ptr<Session> session, int64_t seat, std::string key)
      : session_(std::move(session)), seat_(seat), key_(std::move(key)) {}

  // Finds who sits here, has the request carried out, which is refused if that
  // is an error, and wakes those who see what it changed.
  bool Request(
      uint64_t sequence,
      absl::FunctionRef<absl::Status(Roster::Member&, Outbox&)> carry_out);
  static void Acknowledge(Roster::Member& member, Outbox& outbox,
                          Acknowledgement acknowledgement);

  const std::shared_ptr<Session> session_;
  const int64_t seat_;
  const std::string key_;  // Of its place.
};

}  // namespace deform::server
