#include "core/kernels/multiply_tiles.h"
#include "core/kernels/weight_tiles.h"

namespace deform {

void AddTileProductsPlain(const double* a, int64_t count, int64_t inner,
                          const double* b, int64_t outer, double* out) {
  for (int64_t t = 0; t < count; ++t) {
    for (int64_t o = 0; o < outer; ++o) {
      for (int64_t i = 0; i < kTilePoints; ++i) {
        double sum = 0;
        for (int64_t k = 0; k < inner; ++k) {
          sum += a[(t * inner + k) * kTilePoints + i] * b[k * outer + o];
        }
        out[(t * outer + o) * kTilePoints + i] += sum;
      }
    }
  }
}

void AddTileGramPlain(const double* a, int64_t count, int64_t columns,
                      double* out) {
  for (int64_t j = 0; j < columns; ++j) {
    for (int64_t k = 0; k < columns; ++k) {
      double sum = 0;
      for (int64_t t = 0; t < count; ++t) {
        for (int64_t i = 0; i < kTilePoints; ++i) {
          sum += a[(t * columns + j) * kTilePoints + i] *
                 a[(t * columns + k) * kTilePoints + i];
        }
      }
      out[j * columns + k] += sum;
    }
  }
}

}  // namespace deform
