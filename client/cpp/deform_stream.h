// One participant's place in a session: poses in, frames out.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/deform/pose.h"
#include "core/mesh/types.h"

namespace deform {

class Binding;
class LeafBasis;
class ThreadPool;

// A binding of the server's that this program has, in whatever form.
struct HeldBinding {
  std::string binding_id;
  std::shared_ptr<const Binding> binding;
};

// What the server has of a binding's compressed weights for frames of encoding
// "basis", in this program.
struct HeldBasis {
  std::string basis_id;
  std::shared_ptr<const LeafBasis> basis;
};

// Which frames a participant gets.
enum class Delivery {
  kLatest,  // The newest state whenever there is room; poses may merge.
  kEvery,   // A frame for each pose, in order.
};

enum class ParticipantRole {
  kEditor,
  kViewer,  // Only receives frames: requests are refused.
};

// Somebody who takes part in a session.
struct ParticipantInfo {
  uint64_t id = 0;
  std::string name;
  ParticipantRole role = ParticipantRole::kEditor;
  std::vector<int32_t> grabbed;  // Handles it says it moves.
  std::string cursor;            // Whatever clients agree upon.
  std::vector<int32_t> locked;   // Handles that only it may move.
};

// A request of which frames do not tell all was carried out.
struct AcknowledgedRequest {
  uint64_t sequence = 0;
  uint64_t edit = 0;  // That was undone or redone.
  // Of its vertices, those that others have written since: they stay.
  std::vector<int32_t> left_out;
};

// What to merge with after a conflict.
struct CurrentPose {
  uint64_t revision = 0;
  Pose pose;
};

// How to join a session. By default frames are exact to float32.
struct DeformOptions {
  Delivery delivery = Delivery::kLatest;
  // How far a vertex may come out from its place, in model units or as a
  // fraction of the rig's diagonal at rest; at most one of them. Frames then
  // take a fraction of the bytes.
  std::optional<double> tolerance;
  std::optional<double> tolerance_fraction;
  // Frame encodings to choose from, best first (frame.proto). Empty: "pose" if
  // there are `weights`; else "float32", or, with a tolerance, whichever takes
  // fewest bytes, "basis" if there is a `basis`.
  std::vector<std::string> encodings;
  // With kLatest, frames a second at most, 0.01 to 1000; 0: as they come. The
  // last state always comes.
  double max_fps = 0;
  // Frames come with Frame::normals; FailedPrecondition NO_NORMALS if the model
  // has no faces, or two dimensions.
  bool normals = false;
  // The session's binding (Client::DownloadBinding): with it frames can come as
  // poses (encoding "pose") and are deformed here, on `pool` (borrowed; may be
  // null). Frame::error_bound is then that of these weights.
  HeldBinding weights = {};
  // Of the session's binding, if its weights are compressed
  // (Client::DownloadBasis): with it frames can come as leaf coefficients
  // (encoding "basis") and are summed up here, likewise.
  HeldBasis basis = {};
  ThreadPool* pool = nullptr;

  ParticipantRole role = ParticipantRole::kEditor;
  std::string name;  // Shown to others; at most 64 bytes.
  // How long a broken connection is joined again, before the stream ends with
  // Unavailable RECONNECT_TIMEOUT; 0: it ends at once, for the reason it broke.
  std::chrono::milliseconds reconnect_for{30000};
  // Called by NextFrame(), while it waits, when somebody has come, changed or
  // gone. Without it the server tells nothing of others.
  std::function<void(const std::vector<ParticipantInfo>&)> on_participants;
  // Likewise, for locks, undo and redo.
  std::function<void(const AcknowledgedRequest&)> on_acknowledged;
};

// What a pose asks for.
struct PoseOptions {
  // The rig it is meant for, as in DeformStream::Send().
  std::optional<uint64_t> rig_changes;
  // Poses with the same number, one after the other, are one edit that can be
  // undone, such as a drag. 0: cannot be undone.
  uint64_t edit = 0;
  // Refused with Aborted REVISION_CONFLICT if others have written its vertices
  // after this revision; conflict() tells what there is then.
  std::optional<uint64_t> base_revision;
};

// The deformed model of one revision of the session.
struct Frame {
  uint64_t revision = 0;
  uint64_t epoch = 0;
  // Up to which the session outlived the server's end when this was sent.
  uint64_t durable_revision = 0;
  // The newest of our poses that this revision contains; 0 for none.
  uint64_t answers_sequence = 0;
  int dimension = 3;
  // N x dimension, relative to `origin`.
  std::vector<float> positions;
  Vec3 origin = Vec3::Zero();
  // If they were asked for: N x 3, unit normals of the deformed faces around
  // each vertex, weighted by area, within a degree; (0, 0, 1) where there is no
  // area.
  std::vector<float> normals;
  // Revisions not delivered since the frame before.
  uint64_t skipped_revisions = 0;
  // Weight columns that deforming applied.
  int64_t columns_applied = 0;
  // How far crossed faces are from the similarity of their exit face, as a
  // fraction of its stretch; see ExitMismatch() in core/deform/columns.h.
  double exit_mismatch = 0;
  // What the server spent deforming.
  int64_t deform_us = 0;
  std::string encoding;
  int64_t bytes = 0;  // As they came, encoded.
  // Shown without another frame.
  bool keyframe = false;
  // How far compressed weights and the encoding may have moved any vertex, in
  // model units, beside roundings to float.
  double error_bound = 0;
  // Which basis Client::DownloadBasis has for the weights of this frame, as far
  // as the server tells: it does in sessions in which somebody takes "basis".
  std::string basis_id;

  int64_t point_count() const {
    return static_cast<int64_t>(positions.size()) / dimension;
  }
  // N x 3, model units.
  Positions DoublePositions() const;
};

// The session has moved to a binding of edited handles: from now on poses have
// its rows.
struct RigChange {
  std::string binding_id;
  uint64_t revision = 0;     // Of the first frame with it.
  int64_t vertex_count = 0;  // Rows of a pose.
  // Of each of them: which row it was before, or -1 for a new handle.
  std::vector<int32_t> previous;
  // As it is: handles that stay have kept their places, new ones and those that
  // were moved at rest are where the pose before has carried them.
  Pose pose;
  // How far the change moved any point of the model, in units of D.
  double largest_jump = 0;
};

// What the server told at joining.
struct JoinedSession {
  std::string session_id;
  std::string binding_id;
  std::string encoding;
  double tolerance = 0;  // Model units; 0: the encoding is exact.
  int dimension = 3;
  int64_t point_count = 0;
  int64_t vertex_count = 0;  // Rows of a pose.
  uint64_t revision = 0;
  Pose pose;
  uint64_t participant_id = 0;  // The same over all connections.
};

// One thread may send while another receives; neither side may be used by two
// threads at once. Cancel() may be called from any.
//
// If the connection breaks, NextFrame() joins again: the application sees a
// short stall. What was sent and not answered is kept, up to 4096 requests or
// 64 MiB, and sent again as far as the server has not accepted it, so that each
// is carried out once. The place is kept for a while on the server; if it has
// forgotten it, all that was not answered is sent again. If the server died,
// poses that it answered and had not made durable yet are sent again, too.
// Revisions of that time are skipped, also with Delivery::kEvery.
//
// With Delivery::kEvery the server takes a pose only when the frame before has
// room: who sends many poses before reading blocks in Send() for ever. Keep a
// few in flight, or read on a thread of its own.
class DeformStream {
 public:
  class Impl;
  explicit DeformStream(std::unique_ptr<Impl> impl);
  DeformStream(DeformStream&&) noexcept;
  DeformStream& operator=(DeformStream&&) noexcept;
  // Cancels what is still under way.
  ~DeformStream();

  const JoinedSession& joined() const;

  // Sends a pose, whole or in part, and returns its sequence number, counted
  // from 1. Blocks while the connection is full, but not while it is broken. An
  // error means that the stream has ended, and NextFrame() tells why, that
  // Close() was called, or ResourceExhausted UNANSWERED_LIMIT: so many wait
  // that frames must be read first.
  //
  // The pose is meant for the rig as it is after the first `rig_changes`
  // changes; without them, after all that NextFrame() has told. Who sends on a
  // thread of its own says for how many its poses are made. A pose for an older
  // rig is taken over to the present one, handle by handle.
  absl::StatusOr<uint64_t> Send(const PoseUpdate& update);
  absl::StatusOr<uint64_t> Send(const PoseUpdate& update, uint64_t rig_changes);

  absl::StatusOr<uint64_t> Send(const PoseUpdate& update,
                                const PoseOptions& options);

  // Keeps others from moving these handles, or all that are locked, for a lease
  // of up to a minute (0: 5 s); locking again extends it. Refused with
  // FailedPrecondition HANDLE_LOCKED if another has one of them.
  absl::StatusOr<uint64_t> Lock(std::span<const int32_t> handles,
                                std::chrono::milliseconds lease = {});
  // All, if none is named.
  absl::StatusOr<uint64_t> Unlock(std::span<const int32_t> handles = {});
  // Takes one's newest edit back, or does it again (session.proto). Answered by
  // a frame, too. FailedPrecondition NOTHING_TO_UNDO, NOTHING_TO_REDO,
  // EDIT_OVERWRITTEN.
  absl::StatusOr<uint64_t> Undo();
  absl::StatusOr<uint64_t> Redo();
  // What others are to see: handles one moves, and up to 256 bytes.
  absl::Status Show(std::span<const int32_t> grabbed, absl::string_view cursor);

  // Asks for a frame that refers to no other; it comes without a pose, too.
  // Part of the sending side. Frames need none: it serves those who record
  // them.
  absl::Status RequestKeyframe();

  // Waits for the next frame and puts it into `frame`, whose memory is reused.
  // The first shows the session as it is at joining. Otherwise returns
  //   OutOfRange  after Close(), once every pose is answered
  //   the reason why the server refused a pose: rejected_sequence() names it,
  //     ended() is false, and the stream goes on
  //   the error that ended the stream; ended() is true
  absl::Status NextFrame(Frame& frame);

  // How the rig has changed since joining, as of the last frame; part of the
  // receiving side.
  const std::vector<RigChange>& rig_changes() const;
  // These are DeformOptions::weights from now on; part of the receiving side.
  // After a rig change frames come in another encoding until the weights of its
  // binding are here. InvalidArgument OTHER_MODEL.
  absl::Status Hold(const HeldBinding& weights);
  // Likewise DeformOptions::basis, when Frame::basis_id tells of another.
  absl::Status Hold(const HeldBasis& basis);

  // Part of the receiving side: who takes part, if on_participants is set; what
  // came with the last refusal; how often the connection broke and came back.
  const std::vector<ParticipantInfo>& participants() const;
  const std::optional<CurrentPose>& conflict() const;
  int64_t reconnections() const;

  uint64_t rejected_sequence() const;
  bool ended() const;

  // Says that no more poses come; part of the sending side. Frames still come
  // until all are answered.
  void Close();
  // Ends the stream at once; a waiting NextFrame() returns Cancelled.
  void Cancel();

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace deform
