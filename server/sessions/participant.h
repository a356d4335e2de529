// A place in a session, as the stream that took it sees it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "server/sessions/outbox.h"

namespace deform::server {

class Session;

// Leaves when it goes. Thread-safe.
class Participant {
 public:
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  const Session& session() const { return *session_; }

  // Accepts the pose, or puts a rejection into the outbox. `rig_changes`: how
  // many RigChanged its sender knew of; what is meant for an older rig is taken
  // over (PoseTransfer). Rejected are, beside an `update` that is a status,
  // what CheckPoseUpdate() and PoseTransfer refuse and InvalidArgument
  // SEQUENCE_NOT_RISING, RIG_CHANGED (too often), RIG_UNKNOWN (not yet so
  // often). Needs WantsPoses(). True if it was accepted.
  bool Submit(uint64_t sequence, const absl::StatusOr<PoseUpdate>& update,
              uint64_t rig_changes = 0);
  // False while as many of its poses or rejections wait as may. The receiver
  // is woken when that changes.
  bool WantsPoses() const;
  // What it held is lost: the next frame is to refer to no other.
  void WantKeyframe();
  // No more poses come; the stream ends OK once those that came are answered.
  void HalfClose();

  // The next to be sent; what was taken before has been sent. Nothing: the
  // receiver will be woken.
  std::optional<Outgoing> Take();
  // Part of what was taken has been sent.
  void Progressed();
  // Aborted RECEIVER_STALLED if the same message has been under way for longer
  // than the stall timeout: then it is to leave.
  absl::Status CheckStall() const;
  // Gives up the place. Others no longer wait for it.
  void Leave();

 private:
  friend class Session;
  Participant(std::shared_ptr<Session> session, int64_t seat)
      : session_(std::move(session)), seat_(seat) {}

  const std::shared_ptr<Session> session_;
  const int64_t seat_;
};

}  // namespace deform::server
