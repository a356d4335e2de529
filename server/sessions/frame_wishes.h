// What a participant says about its frames when it joins, and what it gets.
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/frames/encoding.h"
#include "core/mesh/mesh.h"
#include "core/mesh/rig.h"
#include "server/sessions/frame.h"
#include "server/sessions/outbox.h"

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
  // Frames a second, at most; 0: as they come.
  double max_fps = 0;
  bool normals = false;
  WeightsId weights;  // That it has.

  bool TakesBasis() const;  // Frames that need one.
};

// What it gets.
struct Subscription {
  Delivery delivery = Delivery::kLatest;
  FrameFormat format;
  // While it does not have the weights that frames of `format` need.
  FrameFormat otherwise;
  WeightsId weights;
  bool normals = false;
  // Between two frames, at least; only with kLatest.
  std::chrono::nanoseconds interval{0};
};

struct FrameFormats {
  FrameFormat format;
  FrameFormat otherwise;  // Needs no weights.
};

// The first or cheapest encoding that keeps the tolerance for the model at
// rest, and that of those which need no weights. InvalidArgument:
//   CONTRADICTION           both tolerances
//   TOLERANCE_MISSING       encodings that need one, without
//   TOLERANCE_OUT_OF_RANGE  see CheckTolerance()
//   TOLERANCE_NOT_MET       by none of the encodings: says what they keep
absl::StatusOr<FrameFormats> PickFormats(const FrameWishes& wishes,
                                         const Rig& rig);

// And InvalidArgument:
//   MAX_FPS_OUT_OF_RANGE
//   CONTRADICTION           fewer frames than all, and all of them
// FailedPrecondition:
//   NO_NORMALS              of a model without faces, or in 2D
absl::StatusOr<Subscription> Subscribe(Delivery delivery,
                                       const FrameWishes& wishes,
                                       const Rig& rig, const Mesh& model);

}  // namespace deform::server
