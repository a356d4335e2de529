// Celestial coordinates of one point, with all that may become of it.
#pragma once

#include <cstdint>
#include <span>

#include "core/weights/scheme.h"
#include "core/weights/schemes/celestial_newton.h"

namespace deform {

enum class CelestialKind {
  kTranslation,  // T-CC: beta = s + exp(u).
  kScaling,      // S-CC: beta = exp(asinh u)^2.
};

struct CelestialPoint {
  PointState state = PointState::kNotConverged;
  int iterations = 0;  // Newton steps, restarts included.
  // Where the search ended: a start for neighbours. 0 if there is no solution.
  WideVec3 y = WideVec3::Zero();
  double residual = 0;  // |sum beta q| / sum beta of a bound point.
};

// Solves for the n `weights` of the point from which `directions` look; all 0
// if it is not bound. `s` are the n user weights of T-CC; S-CC does not read
// them. `tolerance` is the length up to which the point's own coordinates are
// uncertain: so far outside the hull it counts as on it.
//
// On the hull the weights are their limit: the same scheme on the supporting
// face. T-CC has none if a handle off that face has s > 0: kOutsideHull.
//
// The result depends on `start` by rounding only.
CelestialPoint SolveCelestial(CelestialKind kind, const Directions& directions,
                              std::span<const double> s, double tolerance,
                              const WideVec3& start, std::span<double> weights);

}  // namespace deform
