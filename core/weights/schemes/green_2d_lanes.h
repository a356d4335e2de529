// Green coordinates of the 16 points of a tile at once, in the plane; see
// green_3d_lanes.h. green_2d.cc judges it.
#pragma once

#include <cstdint>

#include "core/weights/schemes/lane_points.h"

namespace deform {

struct GreenLaneSegment {
  int32_t from, to;
  double a[2];  // to - from
  double length;
};

// Oriented loops as the kernels read them. Lengths are in a unit in which they
// measure about 1, but for psi.
struct GreenLaneLoops {
  int64_t vertices, edges;
  const double* vertex;  // V x 3
  const GreenLaneSegment* edge;
  double psi;       // 1 / 2 pi, in model units.
  double log_unit;  // ln of the unit squared, in model units.
  double touch;     // Closer to an edge than this, a point goes the plain way.
};

int64_t Green2dLaneScratch(const GreenLaneLoops& loops);

// Writes phi and psi as (V + E) x 16, closed, in double: to 1e-12. Memory as in
// green_3d_lanes.h.
void IntegrateGreen2d(const GreenLaneLoops& loops, LanePoints& points,
                      void* scratch, double* weights);
// The same rounded.
void IntegrateGreen2d(const GreenLaneLoops& loops, LanePoints& points,
                      void* scratch, float* weights);

}  // namespace deform
