// Products of tall matrices in tiles with small ones, in double: the work of
// compressing weights.
//
// Pointers and counts only; a tile holds 16 points x columns as in
// weight_tiles.h. Judged by the plain versions below.
#pragma once

#include <cstdint>

namespace deform {

// out += a b, for `count` tiles; b is inner x outer by rows:
//   out[(t * outer + o) * 16 + i] +=
//       sum over k of a[(t * inner + k) * 16 + i] * b[k * outer + o]
void AddTileProducts(const double* a, int64_t count, int64_t inner,
                     const double* b, int64_t outer, double* out);

// The products of all pairs of columns, summed over the points of `count`
// tiles; columns x columns by rows, symmetric before and after:
//   out[j * columns + k] += sum over t and i of
//       a[(t * columns + j) * 16 + i] * a[(t * columns + k) * 16 + i]
void AddTileGram(const double* a, int64_t count, int64_t columns, double* out);

// The judges.
void AddTileProductsPlain(const double* a, int64_t count, int64_t inner,
                          const double* b, int64_t outer, double* out);
void AddTileGramPlain(const double* a, int64_t count, int64_t columns,
                      double* out);

}  // namespace deform
