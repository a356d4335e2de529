// One source, compiled by Highway for each instruction set.
#include "core/kernels/multiply_tiles.h"

#include "core/kernels/weight_tiles.h"

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/multiply_tiles.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<double, kTilePoints> kDoubles;
using Doubles = hn::Vec<decltype(kDoubles)>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kDoubles));
constexpr int kVectors = kTilePoints / kLanes;  // Of one tile and column.

// Columns of the result whose sums (kVectors registers each) stay in registers:
// 32 registers with AVX-512 and NEON, 16 before.
#if HWY_TARGET <= HWY_AVX3 || HWY_ARCH_ARM
constexpr int kRegisters = 32;
#else
constexpr int kRegisters = 16;
#endif
constexpr int kColumns = kRegisters / kVectors > 2
                             ? (kRegisters - kVectors - 4) / kVectors
                             : 1;

// Columns whose products with as many others stay in registers.
constexpr int kSide = kRegisters == 32 ? 4 : 3;

// `kCount` columns of the product of one tile.
template <int kCount>
HWY_INLINE void Multiply(const double* HWY_RESTRICT a, int64_t inner,
                         const double* HWY_RESTRICT b, int64_t outer,
                         double* HWY_RESTRICT out) {
  Doubles sums[kCount][kVectors];
  for (int o = 0; o < kCount; ++o) {
    for (int v = 0; v < kVectors; ++v) {
      sums[o][v] = hn::LoadU(kDoubles, out + o * kTilePoints + v * kLanes);
    }
  }
  for (int64_t k = 0; k < inner; ++k) {
    for (int v = 0; v < kVectors; ++v) {
      const Doubles x = hn::LoadU(kDoubles, a + k * kTilePoints + v * kLanes);
      for (int o = 0; o < kCount; ++o) {
        sums[o][v] =
            hn::MulAdd(x, hn::Set(kDoubles, b[k * outer + o]), sums[o][v]);
      }
    }
  }
  for (int o = 0; o < kCount; ++o) {
    for (int v = 0; v < kVectors; ++v) {
      hn::StoreU(sums[o][v], kDoubles, out + o * kTilePoints + v * kLanes);
    }
  }
}

void AddTileProducts(const double* a, int64_t count, int64_t inner,
                     const double* b, int64_t outer, double* out) {
  for (int64_t t = 0; t < count; ++t) {
    const double* tile = a + t * inner * kTilePoints;
    double* sums = out + t * outer * kTilePoints;
    int64_t o = 0;
    for (; o + kColumns <= outer; o += kColumns) {
      Multiply<kColumns>(tile, inner, b + o, outer, sums + o * kTilePoints);
    }
    for (; o < outer; ++o) {
      Multiply<1>(tile, inner, b + o, outer, sums + o * kTilePoints);
    }
  }
}

// Columns j .. j + kJ against k .. k + kK.
template <int kJ, int kK>
HWY_INLINE void Gram(const double* HWY_RESTRICT a, int64_t count,
                     int64_t columns, int64_t j, int64_t k,
                     double* HWY_RESTRICT out) {
  Doubles sums[kJ][kK];
  for (auto& row : sums) {
    for (Doubles& sum : row) sum = hn::Zero(kDoubles);
  }
  for (int64_t t = 0; t < count; ++t) {
    const double* tile = a + t * columns * kTilePoints;
    for (int64_t i = 0; i < kTilePoints; i += kLanes) {
      Doubles right[kK];
      for (int q = 0; q < kK; ++q) {
        right[q] = hn::LoadU(kDoubles, tile + (k + q) * kTilePoints + i);
      }
      for (int p = 0; p < kJ; ++p) {
        const Doubles left =
            hn::LoadU(kDoubles, tile + (j + p) * kTilePoints + i);
        for (int q = 0; q < kK; ++q) {
          sums[p][q] = hn::MulAdd(left, right[q], sums[p][q]);
        }
      }
    }
  }
  for (int p = 0; p < kJ; ++p) {
    for (int q = 0; q < kK; ++q) {
      out[(j + p) * columns + k + q] +=
          hn::GetLane(hn::SumOfLanes(kDoubles, sums[p][q]));
    }
  }
}

// Columns j .. j + kJ against those from j on.
template <int kJ>
void GramRows(const double* a, int64_t count, int64_t columns, int64_t j,
              double* out) {
  int64_t k = j;
  for (; k + kSide <= columns; k += kSide) {
    Gram<kJ, kSide>(a, count, columns, j, k, out);
  }
  for (; k < columns; ++k) Gram<kJ, 1>(a, count, columns, j, k, out);
}

void AddTileGram(const double* a, int64_t count, int64_t columns, double* out) {
  int64_t j = 0;
  for (; j + kSide <= columns; j += kSide) {
    GramRows<kSide>(a, count, columns, j, out);
  }
  for (; j < columns; ++j) GramRows<1>(a, count, columns, j, out);
  for (j = 0; j < columns; ++j) {
    for (int64_t k = 0; k < j; ++k) out[j * columns + k] = out[k * columns + j];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(AddTileProducts);
HWY_EXPORT(AddTileGram);

void AddTileProducts(const double* a, int64_t count, int64_t inner,
                     const double* b, int64_t outer, double* out) {
  HWY_DYNAMIC_DISPATCH(AddTileProducts)(a, count, inner, b, outer, out);
}

void AddTileGram(const double* a, int64_t count, int64_t columns, double* out) {
  HWY_DYNAMIC_DISPATCH(AddTileGram)(a, count, columns, out);
}

}  // namespace deform
#endif  // HWY_ONCE
