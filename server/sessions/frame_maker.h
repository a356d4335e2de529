// Frames of a session's present revision, each made once.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/thread_pool.h"
#include "core/deform/deformer.h"
#include "server/sessions/frame.h"
#include "server/sessions/frame_tables.h"

namespace deform::server {

using Frames = std::map<FrameKey, std::shared_ptr<const Frame>>;

// Not thread-safe: used by one step at a time, since it keeps what frames of
// the present revision share.
class FrameMaker {
 public:
  explicit FrameMaker(std::shared_ptr<FrameTables> tables)
      : tables_(std::move(tables)) {}

  // That of the deformers which come from now on; null: of dense weights.
  void SetBasis(std::shared_ptr<const NamedBasis> basis) {
    basis_ = std::move(basis);
  }

  // Encodes where `deformer` is, for every key, chunks in parallel on `pool`
  // (may be null). Where an encoding cannot keep its tolerance the frame is
  // float32, and shared with those who want that.
  Frames Make(const Deformer& deformer, const FrameInfo& info,
              std::span<const FrameKey> keys, ThreadPool* pool);

  // Where `deformer` is, whose model has faces in 3D; once for all who want
  // them of this revision. Blocks of vertices in parallel on `pool` (may be
  // null).
  std::shared_ptr<const FrameNormals> Normals(const Deformer& deformer,
                                              const FrameInfo& info,
                                              ThreadPool* pool);

  // What of `tolerance` is left to an encoding by weights that may have moved a
  // point by `weight_error`. All if that is 0; else 3/4 or 1/2: few values, so
  // that points at rest keep their places on the grid while others move. Where
  // the weights take more than half, Frame::error_bound exceeds the tolerance.
  static double ShareOf(double tolerance, double weight_error);

 private:
  using Grids = std::map<double, std::shared_ptr<const HeldRevision>>;

  // What is kept is of this revision.
  void Begin(const FrameInfo& info);
  absl::StatusOr<std::shared_ptr<const HeldRevision>> GridOf(
      const Deformer& deformer, const FrameInfo& info, double step,
      ThreadPool* pool);
  std::shared_ptr<const HeldRevision> PoseOf(const Deformer& deformer,
                                             const FrameInfo& info);
  absl::StatusOr<std::shared_ptr<const Frame>> Encode(const Deformer& deformer,
                                                      const FrameInfo& info,
                                                      const FrameKey& key,
                                                      ThreadPool* pool);

  const std::shared_ptr<FrameTables> tables_;
  std::shared_ptr<const PointOrder> order_;  // Once a grid was wanted.
  std::shared_ptr<const VertexFans> fans_;   // Once normals were.
  std::shared_ptr<const NamedBasis> basis_;
  uint64_t revision_ = 0;
  // Of the revision: all points relative to the origin, once normals were
  // wanted (encodings then take them from here, too), and what was made.
  std::vector<float> positions_;
  Grids grids_;  // By step.
  std::shared_ptr<const HeldRevision> pose_;
  std::shared_ptr<const FrameNormals> normals_;
};

}  // namespace deform::server
