// Measuring how weights are computed, alone and within Bind().
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/mesh/cage.h"
#include "core/weights/schemes/lane_evaluator.h"

namespace deform::bench {

struct WeightsScene {
  std::string name;
  std::string scheme;  // Its id.
  std::function<std::unique_ptr<const LaneEvaluator>(const Cage&, Way)> make;
  Cage cage;
  Positions points;
};

// One way to compute the weights of a scene.
struct WeightsResult {
  std::string way;
  double seconds_per_point_and_face = 0;  // Of one core.
  // Largest difference from the plain closed form in double, of vertex weights
  // and of normal weights in units of D.
  double error = 0;
};

// The plain closed form first, then the lanes in double and to the precision of
// float on the instruction set in use, Bind() as a whole on one core and, for
// Green coordinates in space, Algorithm 2 of [L08] on some of the points.
std::vector<WeightsResult> MeasureWeights(const WeightsScene& scene);

// Those that issue a table: Green and mean value coordinates in 3D with
// 110/216 and `points` points, in 2D with 40 edges, and models of 100 points.
std::vector<WeightsScene> WeightsScenes(int64_t points);

}  // namespace deform::bench
