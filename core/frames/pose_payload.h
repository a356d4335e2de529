// Frames that carry the pose alone, for clients that hold the weights and
// deform by themselves (encoding "pose").
//
// Bit by bit, all little-endian; R is the number of rows that a pose of the rig
// moves:
//
//   1 byte   0: all rows; 1: those that differ from the reference revision
//   float64  stretch blend, 0 to 1
//   uint32   n, at most R        |
//   n times  uint32 row, rising  | only of some rows
//   float64  `dimension` coordinates of each row, in model units
//
// Coordinates are doubles, bit by bit: who deforms with the same core comes out
// where the server does.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/deform/pose.h"

namespace deform {

// The shorter of both forms; the first if `reference` is null. Both poses are
// of a rig of this shape.
std::vector<uint8_t> EncodePose(const Pose& pose, const Pose* reference,
                                const PoseShape& shape);

// What to apply (ApplyPoseUpdate) to the reference; right, and, if all rows are
// told, to any pose. Takes memory in proportion to the bytes. InvalidArgument:
// BAD_FRAME, or what CheckPoseUpdate() finds in the values.
absl::StatusOr<PoseUpdate> DecodePose(std::span<const uint8_t> bytes,
                                      const PoseShape& shape);

}  // namespace deform
