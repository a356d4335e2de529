// Chunks in, frames out.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/deform_stream.h"
#include "client/cpp/held_weights.h"
#include "core/frames/encoding.h"
#include "core/frames/grid.h"
#include "core/frames/point_order.h"
#include "deform/v1/frame.pb.h"

namespace deform {

// Puts the chunks of one stream together. Holds the integers of two frames at
// most, 12 bytes a point each, the order of points, and a pose, whatever comes.
// Not thread-safe.
class FrameAssembler {
 public:
  // `normals`: frames have them. `weights`: what is held, borrowed; null:
  // nothing.
  FrameAssembler(int dimension, int64_t point_count, bool normals = false,
                 const HeldWeights* weights = nullptr)
      : dimension_(dimension),
        point_count_(point_count),
        normals_(normals),
        weights_(weights) {}

  // The frames that follow are of this binding.
  void BeginBinding(std::string binding_id);

  // Adds a chunk to `frame`, the same for all chunks of a frame. True if it
  // completed it. Chunks come from outside: InvalidArgument (BAD_FRAME) if they
  // do not follow each other, cover all points, refer to what is held or
  // decode. A frame of an epoch older than one seen is dropped.
  absl::StatusOr<bool> Add(const v1::FrameChunk& chunk, Frame& frame);

  // A part of the order in which frames on a grid have their points.
  // InvalidArgument BAD_POINT_ORDER.
  absl::Status AddOrder(const v1::PointOrderChunk& chunk);

 private:
  struct Held {
    uint64_t revision = 0;
    Grid grid;
  };
  struct HeldPose {
    uint64_t revision = 0;
    Pose pose;
  };

  absl::Status Begin(const v1::FrameChunk& chunk, Frame& frame);
  absl::Status BeginOnGrid(const v1::FrameChunk& chunk);
  absl::Status CheckReference(const v1::FrameChunk& chunk,
                              std::optional<uint64_t> held) const;
  absl::Status CheckFollows(const v1::FrameChunk& chunk) const;
  absl::Status Decode(const v1::FrameChunk& chunk, Frame& frame);
  absl::Status ReadNormals(const v1::FrameChunk& chunk, Frame& frame) const;
  // Of a chunk of positions, or of what they are made of.
  ChunkTarget TargetOf(const v1::FrameChunk& chunk, Frame& frame) const;
  void FinishOnGrid(Frame& frame);

  const int dimension_;
  const int64_t point_count_;
  const bool normals_;
  const HeldWeights* const weights_;
  std::string binding_id_;
  std::string basis_id_;  // As it was told.
  uint64_t newest_epoch_ = 0;
  bool have_origin_ = false;
  Vec3 origin_ = Vec3::Zero();
  std::vector<uint8_t> order_bytes_;  // As far as they have come.
  std::optional<PointOrder> order_;
  // What the next frame on a grid, and the next pose, may refer to.
  std::optional<Held> held_;
  std::optional<HeldPose> held_pose_;

  // Of the current frame.
  int64_t next_vertex_ = 0;  // Vertices so far.
  uint64_t revision_ = 0;
  const FrameEncoding* encoding_ = nullptr;
  bool refers_ = false;  // To what is held.
  double step_ = 0;
  std::optional<Grid> grid_;  // Kept for its memory.
};

}  // namespace deform
