// Where the rig is now.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "core/mesh/rig.h"
#include "core/mesh/types.h"

namespace deform {

struct Pose {
  Positions vertices;  // V x 3, model units; fixed handles are at rest.
  // b of the stretch s_b = b s + (1 - b), [L08] Fig. 7: 1 distorts least, 0
  // lets normals keep their length. In [0, 1].
  double stretch_blend = 1;
};

// Some vertices moved.
struct PoseUpdate {
  std::vector<int32_t> vertices;  // Empty: all that move, in order.
  Positions positions;            // One row each.
  std::optional<double> stretch_blend;
};

Pose RestPose(const Rig& rig);

// What a pose of a rig looks like.
struct PoseShape {
  int dimension = 3;
  int64_t rows = 0;   // That a pose moves.
  int64_t fixed = 0;  // Behind them.
};
PoseShape ShapeOf(const Rig& rig);

// InvalidArgument: WRONG_LENGTH, INDEX_OUT_OF_RANGE, FIXED_HANDLE, NON_FINITE,
// COORDINATE_TOO_LARGE, NOT_PLANAR, STRETCH_BLEND_OUT_OF_RANGE.
absl::Status CheckPoseUpdate(const PoseUpdate& update, const PoseShape& shape);
inline absl::Status CheckPoseUpdate(const PoseUpdate& update, const Rig& rig) {
  return CheckPoseUpdate(update, ShapeOf(rig));
}

// Merges a right update; a vertex named twice takes its last place.
void ApplyPoseUpdate(const PoseUpdate& update, Pose& pose);

}  // namespace deform
