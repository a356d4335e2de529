// What a participant says about its frames when it joins, and what it gets.
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/frames/encoding.h"
#include "core/mesh/rig.h"
#include "server/sessions/frame.h"

namespace deform::server {

struct FrameWishes {
  // That it takes, best first; none: float32, which everybody takes.
  std::vector<const FrameEncoding*> encodings;
  // The cheapest of them that keeps the tolerance, instead of the first.
  bool cheapest = false;
  // In model units, or as a fraction of D, the diagonal of the rig at rest. Of
  // compressed weights, encoding and roundings to float together.
  std::optional<double> tolerance;
  std::optional<double> tolerance_fraction;
};

// The first or cheapest encoding that keeps the tolerance for the model at
// rest. InvalidArgument:
//   CONTRADICTION           both tolerances
//   TOLERANCE_MISSING       encodings that need one, without
//   TOLERANCE_OUT_OF_RANGE  see CheckTolerance()
//   TOLERANCE_NOT_MET       by none of the encodings: says what they keep
absl::StatusOr<FrameFormat> PickFormat(const FrameWishes& wishes,
                                       const Rig& rig);

}  // namespace deform::server
