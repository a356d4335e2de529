// Celestial coordinates at many random points among many random handles, the
// hard ones included: how often, how fast and how exactly the solver arrives.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/thread_pool.h"

namespace deform {

// What one scheme did in one configuration. Distances to the hull are in units
// of D; a residual is |sum beta q| / sum beta, found from the weights.
struct SweepRow {
  std::string configuration;
  std::string scheme;
  int64_t points = 0;
  int64_t failures = 0;      // Not bound, though strictly inside.
  int64_t steps = 0;         // Newton steps of all points.
  int steps_max = 0;         // At 1e-6 or further from the hull.
  double residual_far = 0;   // Largest at 1e-3 or further,
  double residual_near = 0;  // from 1e-6 to 1e-3,
  double residual_skin = 0;  // and nearer.
  int64_t in_skin = 0;       // Points that are nearer.
  int64_t on_hull = 0;       // Points taken for points on the hull, which is
  double on_hull_depth = 0;  // so far from the one furthest inside.
};

// About `points` points for each of the configurations random, clustered, skew,
// near-hull (to 1e-6) and of 200 handles, and the schemes S-CC, T-CC and T-CC
// with user weights. The same numbers on every machine; `pool` may be null.
std::vector<SweepRow> SweepCelestial(int64_t points, ThreadPool* pool);

// What the solver promises of a row; empty if it holds, else what does not.
std::string BrokenPromise(const SweepRow& row);

}  // namespace deform
