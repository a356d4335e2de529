// What waits to be sent to one participant.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "core/deform/pose.h"
#include "server/sessions/frame.h"
#include "server/sessions/presence.h"
#include "server/sessions/rig_change.h"

namespace deform::server {

// Which frames a participant gets.
enum class Delivery {
  // The newest, whenever there is room.
  kLatest,
  // All, in order; while its queue is full the session waits.
  kEvery,
};

// A frame with what its header says to this receiver.
struct FrameToSend {
  std::shared_ptr<const Frame> frame;
  std::shared_ptr<const FrameNormals> normals;  // Null if it wants none.
  uint64_t answers_sequence = 0;
  uint64_t skipped_revisions = 0;
  bool tells_origin = false;
  bool tells_basis = false;
};
// Comes before the first frame on a grid.
struct OrderToSend {
  std::shared_ptr<const PointOrder> order;
};
// Comes before the first frame on the new rig.
struct RigChanged {
  std::shared_ptr<const RigChange> change;
};
struct Rejection {
  uint64_t sequence = 0;
  absl::Status status;
  // With a conflict: what there is to merge with, as of when it is taken.
  struct Current {
    uint64_t revision = 0;
    int dimension = 3;
    Pose pose;
  };
  std::optional<Current> current;
};
// A request that no frame answers, or not in full, was carried out.
struct Acknowledgement {
  uint64_t sequence = 0;
  uint64_t edit = 0;  // That was undone or redone.
  std::vector<int32_t> left_out;
};
// The participant's answers, in order.
using Notice = std::variant<Rejection, Acknowledgement>;
// The stream ends; OK: because the participant has finished.
struct Ended {
  absl::Status status;
};
using Outgoing = std::variant<FrameToSend, OrderToSend, RigChanged, Rejection,
                              Acknowledgement, PresenceChange, Ended>;

// Not thread-safe; never holds more than a few frames and notices.
class Outbox {
 public:
  static constexpr size_t kMaxFrames = 4;
  static constexpr size_t kMaxNotices = 16;
  static constexpr size_t kMaxRigChanges = 4;

  explicit Outbox(Delivery delivery) : delivery_(delivery) {}

  Delivery delivery() const { return delivery_; }

  // `answers` is the participant's newest pose in this frame; never falls.
  // Needs !full().
  void Offer(std::shared_ptr<const Frame> frame, uint64_t answers,
             std::shared_ptr<const FrameNormals> normals = nullptr);
  // The next frame must wait until one is taken. Only with kEvery.
  bool full() const;
  bool has_frames() const { return !frames_.empty(); }
  // The next frame is not to wait for anything but room: the stream ends with
  // it, or it is the first on another rig.
  bool in_a_hurry() const { return end_ || !announced_.empty(); }

  // Frames that are offered from now on are of the changed rig. Needs room for
  // rig changes.
  void Announce(std::shared_ptr<const RigChange> change);
  bool has_room_for_rig_changes() const;

  // The pose `sequence` was accepted: a frame will answer it.
  void Expect(uint64_t sequence) { expected_ = sequence; }
  // Need room for notices.
  void Reject(uint64_t sequence, absl::Status status);
  void Notify(Notice notice);
  bool has_room_for_notices() const { return notices_.size() < kMaxNotices; }

  // The participant was here before and has frames up to this revision, from
  // another stream.
  void GoOnFrom(uint64_t revision);

  // Ends with `status` after what was asked so far is answered. The first of
  // these calls decides.
  void EndWhenAnswered(absl::Status status);
  // Ends with `status` now; what waits is dropped.
  void EndNow(absl::Status status);

  // The next to be sent. After Ended there is nothing.
  std::optional<Outgoing> Take();

 private:
  using RigChanges = std::deque<std::shared_ptr<const RigChange>>;
  struct Waiting {
    RigChanges changes;  // To be told before.
    std::shared_ptr<const Frame> frame;
    std::shared_ptr<const FrameNormals> normals;
    uint64_t answers;
  };

  FrameToSend TakeFrame();
  bool Answered() const { return sent_any_ && answered_ >= expected_; }

  const Delivery delivery_;
  std::deque<Waiting> frames_;
  RigChanges announced_;  // Since the last frame.
  std::deque<Notice> notices_;
  std::optional<absl::Status> end_;
  bool ended_ = false;

  uint64_t expected_ = 0;
  // As of the frame taken last.
  uint64_t answered_ = 0;
  uint64_t revision_ = 0;
  uint64_t origin_number_ = 0;
  std::string basis_id_;
  bool sent_any_ = false;
  bool sent_order_ = false;
  bool goes_on_ = false;
};

}  // namespace deform::server
