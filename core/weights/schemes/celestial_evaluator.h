// Celestial coordinates of blocks of points.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/mesh/handles.h"
#include "core/weights/scheme.h"
#include "core/weights/schemes/celestial_lanes.h"
#include "core/weights/schemes/celestial_point.h"

namespace deform {

// `s` are the user weights of T-CC, one for each handle and in range, or empty.
// Without `lanes` every point goes the plain way: the judge of the fast one.
std::unique_ptr<const WeightEvaluator> MakeCelestialEvaluator(
    CelestialKind kind, const Handles& handles, std::vector<double> s,
    std::optional<LaneSolver> lanes);

}  // namespace deform
