// The inner loop of deforming: displacements = weights x columns.
//
// Pointers and counts only. Every fast version is judged by the plain one.
#pragma once

#include <cstdint>

#include "core/kernels/weight_tiles.h"

namespace deform {

// For the 16 points of one tile: out[d * 16 + i] = sum over columns c of
// tile[c * 16 + i] * column[c * 3 + d].
void ApplyTile(const float* tile, int64_t columns, const float* column,
               float* out);

// The same for some columns only, in double, added:
// out[d * 16 + i] += sum over k of tile[index[k] * 16 + i] * delta[k * 3 + d].
// Double, because these sums are kept over many steps; few columns are bound by
// memory, not arithmetic.
void AddTileColumns(const float* tile, const int32_t* index, int64_t count,
                    const double* delta, double* out);

// The judge: ApplyTile in double, one point at a time.
void ApplyTilePlain(const float* tile, int64_t columns, const double* column,
                    double* out);

}  // namespace deform
