// Sums over columns of mixed precision: the last step of deforming with
// compressed weights.
//
// Pointers and counts only; dispatched at run time and judged by the plain
// version, as apply_weights.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/kernels/weight_tiles.h"

namespace deform {

// Points whose numbers of one column lie behind each other: as bytes, they fill
// a cache line.
inline constexpr int64_t kBlockPoints = 64;
inline constexpr int64_t kBlockTiles = kBlockPoints / kTilePoints;

// How many columns of a block hold float, int16 and int8, in this order.
struct MixedColumns {
  int64_t floats = 0;
  int64_t shorts = 0;
  int64_t bytes = 0;

  int64_t count() const { return floats + shorts + bytes; }
  int64_t block_bytes() const {
    return kBlockPoints * (4 * floats + 2 * shorts + bytes);
  }
};

// For `count` blocks, of columns.block_bytes() each:
//   out[(b * 4 + t) * 48 + d * 16 + i] = column[d] +
//       sum over k of number(b, k, t * 16 + i) * column[(k + 1) * 3 + d]
void ApplyMixed(const std::byte* blocks, int64_t count,
                const MixedColumns& columns, const float* column, float* out);

// Number `i` of column `k` of a block.
double MixedNumber(const std::byte* block, const MixedColumns& columns,
                   int64_t k, int64_t i);

// The judge, in double.
void ApplyMixedPlain(const std::byte* blocks, int64_t count,
                     const MixedColumns& columns, const double* column,
                     double* out);

}  // namespace deform
