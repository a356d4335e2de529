// Celestial coordinates of blocks of points.
#pragma once

#include <memory>
#include <vector>

#include "core/mesh/handles.h"
#include "core/weights/scheme.h"
#include "core/weights/schemes/celestial_point.h"

namespace deform {

enum class CelestialWay {
  kLanes,  // Several points at once, the hard ones one by one.
  kPlain,  // One by one: the judge of the other.
};

// `s` are the user weights of T-CC, one for each free handle and in range, or
// empty.
std::unique_ptr<const WeightEvaluator> MakeCelestialEvaluator(
    CelestialKind kind, const Handles& handles, std::vector<double> s,
    CelestialWay way = CelestialWay::kLanes);

}  // namespace deform
