// Celestial coordinates of several points at once, one per vector lane: the way
// of the many easy points. It says which points it did not solve to the last
// digits (outside, next to the hull, at a handle); those go the plain way
// (celestial_point.h), which also judges it.
//
// Pointers and counts only: celestial_lanes.inc is compiled for several
// instruction sets and must not share inline functions with other files.
#pragma once

#include <cstdint>

namespace deform {

inline constexpr int kMaxLanes = 8;

// One group of points, as many as the solver has lanes (L). Arrays are aligned
// to 64 bytes.
struct LaneJob {
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
  // Out. A lane is solved if its bit is set; others hold nothing of use.
  uint32_t solved;
  int steps;  // Newton steps.
};

struct LaneSolver {
  const char* name;  // Of the instruction set.
  int lanes;         // L, at most kMaxLanes.
  void (*solve)(LaneJob& job);
};

// Those that this machine can run, the fastest first.
struct LaneSolvers {
  LaneSolver entries[3];
  int count;
};
LaneSolvers RunnableLaneSolvers();

}  // namespace deform
