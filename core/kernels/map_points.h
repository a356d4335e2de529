// Where deformed points come to lie, from what a pose does to all of them and
// to each.
//
// Pointers and counts only; dispatched at run time and judged by the plain
// version, as apply_weights.h.
#pragma once

#include <cstdint>

namespace deform {

// x -> linear (x - from) + to, seen from `origin`.
struct PointMap {
  double linear[3][3];
  double from[3];
  double to[3];
  double origin[3];
};

// For each of `count` points, 3 numbers each: linear (rest - from) + to +
// displacement - origin, in this order and in double, rounded to float at the
// end. Where nothing but `to` moves points, these are exact as far as double
// goes. `out` overlaps nothing.
void MapPoints(const PointMap& map, const double* rest,
               const double* displacements, int64_t count, float* out);

void MapPointsPlain(const PointMap& map, const double* rest,
                    const double* displacements, int64_t count, float* out);

}  // namespace deform
