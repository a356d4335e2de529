#include "core/kernels/apply_weights.h"

namespace deform {

void ApplyTilesPlain(const float* tiles, int64_t count, int64_t columns,
                     int64_t sets, const double* column, double* out) {
  for (int64_t t = 0; t < count; ++t) {
    for (int64_t s = 0; s < sets; ++s) {
      for (int64_t d = 0; d < 3; ++d) {
        for (int64_t i = 0; i < kTilePoints; ++i) {
          double sum = 0;
          for (int64_t c = 0; c < columns; ++c) {
            sum += double{tiles[(t * columns + c) * kTilePoints + i]} *
                   column[(c * sets + s) * 3 + d];
          }
          out[(t * sets + s) * kTileSums + d * kTilePoints + i] = sum;
        }
      }
    }
  }
}

void ApplyTilesBesidePlain(const float* base, const float* tiles, int64_t count,
                           int64_t columns, const double* column, double* out) {
  ApplyTilesPlain(tiles, count, columns, 1, column, out);
  for (int64_t i = 0; i < count * kTileSums; ++i) out[i] += double{base[i]};
}

void AddTileColumnsPlain(const float* tiles, int64_t count, int64_t columns,
                         const int32_t* index, int64_t changed,
                         const double* delta, double* out) {
  for (int64_t t = 0; t < count; ++t) {
    for (int64_t k = 0; k < changed; ++k) {
      const int64_t c = index != nullptr ? index[k] : k;
      const float* weights = tiles + (t * columns + c) * kTilePoints;
      for (int64_t d = 0; d < 3; ++d) {
        for (int64_t i = 0; i < kTilePoints; ++i) {
          out[t * kTileSums + d * kTilePoints + i] +=
              double{weights[i]} * delta[k * 3 + d];
        }
      }
    }
  }
}

}  // namespace deform
