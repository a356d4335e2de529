// What is said about points without weights.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/weights/exit_regions.h"
#include "core/weights/scheme.h"

namespace deform {

// A weight, or a psi in model units, that float cannot hold.
inline constexpr char kWeightTooLarge[] = "WEIGHT_TOO_LARGE";

// The stable reason of an unbound state: OUTSIDE_HULL, NOT_CONVERGED; null for
// the others.
const char* UnboundReason(PointState state);

// What to do about a reason that has no cause within the model.
std::string UnboundAdvice(const std::string& reason);

// FailedPrecondition that counts the points of each reason and names the first
// ten: "7 points lie outside the cage and have no exit face: 3, 9, 12, 14, 15,
// 20, 21; name exit faces or choose them automatically". Ok if there are none.
absl::Status UnbindableError(const std::vector<UnboundPoints>& unbound);

}  // namespace deform
