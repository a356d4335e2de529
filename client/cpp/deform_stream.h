// One participant's place in a session: poses in, frames out.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "core/mesh/types.h"

namespace deform {

// Which frames a participant gets.
enum class Delivery {
  kLatest,  // The newest state whenever there is room; poses may merge.
  kEvery,   // A frame for each pose, in order.
};

// The deformed model of one revision of the session.
struct Frame {
  uint64_t revision = 0;
  uint64_t epoch = 0;
  // The newest of our poses that this revision contains; 0 for none.
  uint64_t answers_sequence = 0;
  int dimension = 3;
  // N x dimension, relative to `origin`.
  std::vector<float> positions;
  Vec3 origin = Vec3::Zero();
  // Revisions not delivered since the frame before.
  uint64_t skipped_revisions = 0;
  // Weight columns that deforming applied.
  int64_t columns_applied = 0;
  // How far crossed faces are from the similarity of their exit face, as a
  // fraction of its stretch; see ExitMismatch() in core/deform/columns.h.
  double exit_mismatch = 0;
  // What the server spent deforming.
  int64_t deform_us = 0;

  int64_t point_count() const {
    return static_cast<int64_t>(positions.size()) / dimension;
  }
  // N x 3, model units.
  Positions DoublePositions() const;
};

// What the server told at joining.
struct JoinedSession {
  std::string session_id;
  std::string binding_id;
  std::string encoding;
  int dimension = 3;
  int64_t point_count = 0;
  int64_t vertex_count = 0;  // Rows of a pose.
  uint64_t revision = 0;
  Pose pose;
};

// One thread may send while another receives; neither side may be used by two
// threads at once. Cancel() may be called from any.
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
  // from 1. Blocks while the connection is full. An error means that the stream
  // has ended, and NextFrame() tells why, or that Close() was called.
  absl::StatusOr<uint64_t> Send(const PoseUpdate& update);

  // Waits for the next frame and puts it into `frame`, whose memory is reused.
  // The first shows the session as it is at joining. Otherwise returns
  //   OutOfRange  after Close(), once every pose is answered
  //   the reason why the server refused a pose: rejected_sequence() names it,
  //     ended() is false, and the stream goes on
  //   the error that ended the stream; ended() is true
  absl::Status NextFrame(Frame& frame);

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
