// What a pose comes to for the points of a LeafBasis, and back to points.
#pragma once

#include <span>
#include <vector>

#include "absl/status/status.h"
#include "core/base/thread_pool.h"
#include "core/deform/affine_map.h"
#include "core/deform/deformer.h"
#include "core/frames/leaf_basis.h"

namespace deform {

struct LeafPose {
  AffineMap map;                    // T
  std::vector<float> coefficients;  // coefficient_rows() x 3; z is 0 in 2D.
};

// Of a deformer whose binding has compressed weights; does not look at points.
LeafPose LeafPoseOf(const Deformer& deformer);

// All points relative to `origin`, N x dimension, in the order of the model:
// the very floats of Deformer::CopyRelative(), if the pose is LeafPoseOf() it
// and this processor has the same vector instructions; on another float sums
// may be rounded otherwise. InvalidArgument BAD_FRAME if a point comes out at
// no finite place; what `positions` hold then is not specified. `pool` may be
// null.
absl::Status PlacePoints(const LeafPose& pose, const LeafBasis& basis,
                         const Vec3& origin, ThreadPool* pool,
                         std::span<float> positions);

}  // namespace deform
