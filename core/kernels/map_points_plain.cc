#include "core/kernels/map_points.h"

namespace deform {

void MapPointsPlain(const PointMap& map, const double* rest,
                    const double* displacements, int64_t count, float* out) {
  for (int64_t i = 0; i < 3 * count; i += 3) {
    for (int d = 0; d < 3; ++d) {
      double x = 0;
      for (int k = 0; k < 3; ++k) {
        x += map.linear[d][k] * (rest[i + k] - map.from[k]);
      }
      x = x + map.to[d] + displacements[i + d];
      out[i + d] = static_cast<float>(x - map.origin[d]);
    }
  }
}

}  // namespace deform
