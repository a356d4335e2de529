#include <cstring>

#include "core/kernels/apply_mixed.h"
#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

template <typename Number>
double NumberAt(const std::byte* column, int64_t i) {
  Number number;
  std::memcpy(&number, column + i * int64_t{sizeof(Number)}, sizeof(Number));
  return number;
}

}  // namespace

double MixedNumber(const std::byte* block, const MixedColumns& columns,
                   int64_t k, int64_t i) {
  const std::byte* shorts = block + 4 * kBlockPoints * columns.floats;
  const std::byte* bytes = shorts + 2 * kBlockPoints * columns.shorts;
  if (k < columns.floats) {
    return NumberAt<float>(block + 4 * kBlockPoints * k, i);
  }
  k -= columns.floats;
  if (k < columns.shorts) {
    return NumberAt<int16_t>(shorts + 2 * kBlockPoints * k, i);
  }
  return NumberAt<int8_t>(bytes + kBlockPoints * (k - columns.shorts), i);
}

void ApplyMixedPlain(const std::byte* blocks, int64_t count,
                     const MixedColumns& columns, const double* column,
                     double* out) {
  for (int64_t b = 0; b < count; ++b) {
    const std::byte* block = blocks + b * columns.block_bytes();
    for (int64_t d = 0; d < 3; ++d) {
      for (int64_t i = 0; i < kBlockPoints; ++i) {
        double sum = column[d];
        for (int64_t k = 0; k < columns.count(); ++k) {
          sum += MixedNumber(block, columns, k, i) * column[(k + 1) * 3 + d];
        }
        out[(b * kBlockTiles + i / kTilePoints) * kTileSums + d * kTilePoints +
            i % kTilePoints] = sum;
      }
    }
  }
}

}  // namespace deform
