// The inner loops of deforming: displacements = weights x columns.
//
// Pointers and counts only. Each call picks the widest instruction set the
// machine has; all are judged by the plain versions below.
#pragma once

#include <cstdint>

#include "core/kernels/weight_tiles.h"

namespace deform {

// Sums of one tile for one set of columns: x, y and z of 16 points.
inline constexpr int64_t kTileSums = 3 * kTilePoints;

// For `count` consecutive tiles and `sets` sets of columns (several sessions on
// one binding), in one pass over the weights:
//   out[(t * sets + s) * 48 + d * 16 + i] =
//       sum over c of tiles[(t * columns + c) * 16 + i] * column[(c * sets + s)
//       * 3 + d]
// Reads the weights once; works at the memory's speed for one set.
void ApplyTiles(const float* tiles, int64_t count, int64_t columns,
                int64_t sets, const float* column, float* out);

// Some columns only, of one set, added, in double: for `count` tiles
//   out[t * 48 + d * 16 + i] +=
//       sum over k of tiles[(t * columns + index[k]) * 16 + i] * delta[k * 3 +
//       d]
// Double, because these sums are kept over many steps; few columns are bound by
// memory, not by arithmetic. `index` may be null: the first `changed` columns.
// Columns that lie scattered over the tiles take four times as long.
void AddTileColumns(const float* tiles, int64_t count, int64_t columns,
                    const int32_t* index, int64_t changed, const double* delta,
                    double* out);

// All columns of few, of one set, beside what others come to: for `count` tiles
//   out[t * 48 + d * 16 + i] = base[t * 48 + d * 16 + i] +
//       sum over c of tiles[(t * columns + c) * 16 + i] * column[c * 3 + d]
void ApplyTilesBeside(const float* base, const float* tiles, int64_t count,
                      int64_t columns, const float* column, float* out);

// The judges: the same sums in double, one after the other.
void ApplyTilesPlain(const float* tiles, int64_t count, int64_t columns,
                     int64_t sets, const double* column, double* out);
void ApplyTilesBesidePlain(const float* base, const float* tiles, int64_t count,
                           int64_t columns, const double* column, double* out);
void AddTileColumnsPlain(const float* tiles, int64_t count, int64_t columns,
                         const int32_t* index, int64_t changed,
                         const double* delta, double* out);

}  // namespace deform
