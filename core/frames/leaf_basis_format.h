// How a LeafBasis lies in bytes; leaf_basis.h has the format in words.
#pragma once

#include <bit>
#include <cstdint>

#include "core/kernels/apply_mixed.h"

namespace deform {

static_assert(std::endian::native == std::endian::little,
              "numbers are copied as they lie in memory");

inline constexpr uint32_t kLeafBasisVersion = 1;

struct LeafBasisHead {
  uint32_t version;
  uint32_t dimension;
  uint32_t points;
  uint32_t slots;
  uint32_t leaves;
  uint32_t zero;
};
static_assert(sizeof(LeafBasisHead) == 24);

struct LeafHead {
  uint32_t blocks;
  uint32_t floats;
  uint32_t shorts;
  uint32_t bytes;

  MixedColumns columns() const {
    return {.floats = floats, .shorts = shorts, .bytes = bytes};
  }
};
static_assert(sizeof(LeafHead) == 16);

// Blocks that slots fill.
inline int64_t BlocksOf(int64_t slots) {
  return (slots + kBlockPoints - 1) / kBlockPoints;
}

// Where the parts begin.
struct LeafBasisLayout {
  LeafBasisLayout(int64_t points, int64_t leaves, int64_t columns)
      : rest(int64_t{sizeof(LeafBasisHead)} +
             leaves * int64_t{sizeof(LeafHead)}),
        slots(rest + points * 3 * int64_t{sizeof(double)}),
        exponents(slots + points * int64_t{sizeof(int32_t)}),
        padding(exponents + columns),
        blocks((padding + 63) / 64 * 64) {}

  int64_t rest;
  int64_t slots;
  int64_t exponents;
  int64_t padding;
  int64_t blocks;
};

}  // namespace deform
