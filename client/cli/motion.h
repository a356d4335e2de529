// Built-in motions of a rig, for trying things out.
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/mesh/types.h"

namespace deform::cli {

// "twist", "bend", "stretch", "pulse".
std::span<const char* const> MotionNames();

// The vertices `rest` (V x 3) at `time` of the motion, which begins and ends at
// rest, at 0 and 1. Moves along the longest axis of the rig's box. 2D rigs stay
// in the plane z = 0. InvalidArgument for an unknown name, and for twisting a
// flat rig.
absl::StatusOr<Positions> PoseOfMotion(const std::string& name,
                                       const Positions& rest, int dimension,
                                       double time);

}  // namespace deform::cli
