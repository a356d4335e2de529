#include <algorithm>
#include <cmath>

#include "core/kernels/measure_weights.h"

namespace deform {

void MeasureTilePlain(const float* tile, int64_t columns, int64_t vertices,
                      const double* column, TileMeasures& measures) {
  measures = {};
  for (int64_t c = 0; c < columns; ++c) {
    for (int64_t i = 0; i < kTilePoints; ++i) {
      const double weight = tile[c * kTilePoints + i];
      for (int d = 0; d < 3; ++d) {
        measures.position[d][i] += weight * column[3 * c + d];
      }
      double* sum = c < vertices ? measures.vertex_sum : measures.normal_sum;
      sum[i] += std::abs(weight);
      if (c >= vertices) continue;
      measures.vertex_total[i] += weight;
      measures.vertex_min[i] =
          c == 0 ? weight : std::min(measures.vertex_min[i], weight);
      measures.vertex_max[i] =
          c == 0 ? weight : std::max(measures.vertex_max[i], weight);
    }
  }
}

}  // namespace deform
