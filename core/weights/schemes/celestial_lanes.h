// Celestial coordinates of several points at once, one per vector lane: the way
// of the many easy points. It says which points it did not solve to the last
// digits (outside, next to the hull, at a handle); those go the plain way
// (celestial_point.h), which also judges it.
//
// Pointers and counts only.
#pragma once

#include <cstdint>

namespace deform {

inline constexpr int kMaxCelestialLanes = 8;

// Points that one call solves: L, at most kMaxCelestialLanes. Depends on the
// machine.
int CelestialLanes();

// One group of L points. Arrays are aligned to 64 bytes.
struct CelestialLaneJob {
  // n handles; `s` are the user weights of T-CC, null for S-CC.
  int64_t handles;
  const double* x;
  const double* y;
  const double* z;
  const double* s;
  const double* points;  // 3 x L: x of all points, then y, then z.
  double* scratch;       // 8 n x L, for the solver's use.

  double* weights;   // n x L; they sum to 1 in each solved lane.
  double* solution;  // 3 x L: where to start, then where the search ended.
  double* residual;  // L: |sum beta q| / sum beta of the weights.
  // Out. A lane is solved if its bit is set; others hold nothing of use.
  uint32_t solved;
  int steps;  // Newton steps.
};

void SolveCelestialLanes(CelestialLaneJob& job);

}  // namespace deform
