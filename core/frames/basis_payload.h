// Frames that carry leaf coefficients, for clients that hold the LeafBasis of a
// binding and multiply by themselves (encoding "basis").
//
// Bit by bit, all little-endian:
//
//   float64  A, dimension x dimension, by rows
//   float64  from, dimension numbers
//   float64  to, dimension numbers: T eta = A (eta - from) + to
//   float64  unit, 0 or positive and finite
//
// If unit is 0, then for each leaf, for c_0 and each column's c_k, `dimension`
// float32. Else bits, as folded_bits.h fills bytes with them; "(k)" tells the
// parameter. For each leaf
//
//   number (2)      s less that of the leaf before; s is 0 to 127
//
// and then, for each two of c_0, c_1, c_2 ... (the last may be alone),
//
//   number (1), (0) p less that of the two before; but a leaf's first two tell
//                   it with 1, less that of the first two of the leaf before,
//                   and all others with 0; p is 0 to 31
//   numbers (p - 1) n of the `dimension` coordinates of each of the two; left
//                   out if p is 0: then all are 0
//
// Before the first leaf s and p are 0. A coefficient is, in double and then
// rounded to float,
//
//   n * (unit * (4 + s mod 4) * 2^(s div 4 - e_k)),   e_0 = 0
//
// and points follow as leaf_basis.h has it. There are never more bytes than the
// first form has. Each frame stands by itself.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/thread_pool.h"
#include "core/frames/leaf_basis.h"
#include "core/frames/leaf_pose.h"

namespace deform {

// `pose` is of `basis`. Rounds coefficients so that no point is farther than
// `tolerance`, in model units, from where it was; 0: not at all. Roundings to
// float come on top, as in a frame of floats. About the work of PlacePoints();
// `pool` may be null. InvalidArgument NON_FINITE: a number is
// not finite, or so large that sums of it may not be.
absl::StatusOr<std::vector<uint8_t>> EncodeLeafPose(const LeafPose& pose,
                                                    const LeafBasis& basis,
                                                    double tolerance,
                                                    ThreadPool* pool);

// No payload is longer.
int64_t MaxLeafPoseBytes(const LeafBasis& basis);

// From outside: InvalidArgument BAD_FRAME. All numbers of the result are
// finite.
absl::StatusOr<LeafPose> DecodeLeafPose(std::span<const uint8_t> bytes,
                                        const LeafBasis& basis);

}  // namespace deform
