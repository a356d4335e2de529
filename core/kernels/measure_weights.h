// What cached weights come to, measured on the floats themselves.
//
// Pointers and counts only; dispatched at run time and judged by the plain
// version, as apply_weights.h.
#pragma once

#include <cstdint>

#include "core/kernels/weight_tiles.h"

namespace deform {

// Of the 16 points of one tile. Not finite where a weight is not.
struct alignas(64) TileMeasures {
  double position[3][kTilePoints];   // Sum of weight x column, in double.
  double vertex_sum[kTilePoints];    // Sum of |weight| of the vertices.
  double vertex_total[kTilePoints];  // Sum of their weights.
  double vertex_min[kTilePoints];    // The smallest and the largest of them.
  double vertex_max[kTilePoints];
  double normal_sum[kTilePoints];  // Sum of |weight| of the normals.
};

// `column` has x, y and z of each column; the first `vertices` of the
// `columns` columns belong to vertices.
void MeasureTile(const float* tile, int64_t columns, int64_t vertices,
                 const double* column, TileMeasures& measures);

void MeasureTilePlain(const float* tile, int64_t columns, int64_t vertices,
                      const double* column, TileMeasures& measures);

}  // namespace deform
