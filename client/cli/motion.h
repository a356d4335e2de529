// Built-in motions of a rig, for trying things out.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/types.h"

namespace deform::cli {

// "twist", "bend", "stretch", "pulse", "beat", "wave".
const std::vector<std::string>& MotionNames();
// The same for people, with "or".
std::string MotionList();

// The vertices `rest` (V x 3) at `time` of the motion, which begins and ends at
// rest, at 0 and 1. Moves along the longest axis of the rig's box. 2D rigs stay
// in the plane z = 0. InvalidArgument for an unknown name, and for twisting a
// flat rig.
//
// "beat" and "wave" are those of an organ among handles ([C16] Fig. 5 and 6): a
// contraction of the whole with a twist, and one that travels along. The
// farther out a handle, the less it moves; the corners of the box do not.
absl::StatusOr<Positions> PoseOfMotion(const std::string& name,
                                       const Positions& rest, int dimension,
                                       double time);

}  // namespace deform::cli
