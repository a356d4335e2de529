// One source, compiled by Highway for each instruction set.
#include "core/kernels/apply_weights.h"

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/apply_weights.cc"
#include "hwy/cache_control.h"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<float, kTilePoints> kFloats;
using Floats = hn::Vec<decltype(kFloats)>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats));
constexpr int kVectors = kTilePoints / kLanes;  // Of one tile and column.

constexpr hn::CappedTag<double, kTilePoints> kDoubles;
using Doubles = hn::Vec<decltype(kDoubles)>;
constexpr int kDoubleLanes = static_cast<int>(hn::MaxLanes(kDoubles));
constexpr int kDoubleVectors = kTilePoints / kDoubleLanes;

// Pairs of tile and set whose sums (3 kVectors registers each) stay in
// registers: 32 registers with AVX-512 and NEON, 16 before.
#if HWY_TARGET <= HWY_AVX3 || HWY_ARCH_ARM
constexpr int kRegisters = 32;
#else
constexpr int kRegisters = 16;
#endif
constexpr int kPairs = kRegisters / (4 * kVectors) > 1
                           ? kRegisters / (4 * kVectors)
                           : 1;
// One set: several tiles far apart, since the memory serves several forward
// walks better than one.
constexpr int kWalks = kPairs < 4 ? kPairs : 4;
// Several sets: a broadcast column serves all tiles, a tile all sets.
constexpr int kSets = kPairs < 4 ? kPairs : 4;
constexpr int kTilesOfSets = kPairs / kSets;

constexpr int64_t kPrefetchBytes = 1024;

// `kTiles` tiles, `stride` tiles apart, times `kCount` of `sets` sets; begins
// at `base`, laid out as `out`, or, if null, at 0.
template <int kTiles, int kCount, int64_t kAhead = kPrefetchBytes>
HWY_INLINE void Apply(const float* HWY_RESTRICT tiles, int64_t stride,
                      int64_t columns, int64_t sets,
                      const float* HWY_RESTRICT column,
                      const float* HWY_RESTRICT base, float* HWY_RESTRICT out) {
  Floats sums[kTiles][kCount][3][kVectors];
  for (int t = 0; t < kTiles; ++t) {
    for (int s = 0; s < kCount; ++s) {
      for (int d = 0; d < 3; ++d) {
        for (int v = 0; v < kVectors; ++v) {
          sums[t][s][d][v] =
              base == nullptr
                  ? hn::Zero(kFloats)
                  : hn::LoadU(kFloats, base +
                                           (t * stride * sets + s) * kTileSums +
                                           d * kTilePoints + v * kLanes);
        }
      }
    }
  }
  for (int64_t c = 0; c < columns; ++c) {
    for (int t = 0; t < kTiles; ++t) {
      const float* weights = tiles + (t * stride * columns + c) * kTilePoints;
      hwy::Prefetch(reinterpret_cast<const char*>(weights) + kAhead);
      for (int v = 0; v < kVectors; ++v) {
        const Floats w = hn::Load(kFloats, weights + v * kLanes);
        for (int s = 0; s < kCount; ++s) {
          for (int d = 0; d < 3; ++d) {
            sums[t][s][d][v] =
                hn::MulAdd(w, hn::Set(kFloats, column[(c * sets + s) * 3 + d]),
                           sums[t][s][d][v]);
          }
        }
      }
    }
  }
  for (int t = 0; t < kTiles; ++t) {
    for (int s = 0; s < kCount; ++s) {
      for (int d = 0; d < 3; ++d) {
        for (int v = 0; v < kVectors; ++v) {
          hn::StoreU(sums[t][s][d][v], kFloats,
                     out + (t * stride * sets + s) * kTileSums +
                         d * kTilePoints + v * kLanes);
        }
      }
    }
  }
}

// All sets of `kTiles` tiles: the second and later groups of sets find the
// weights in the first cache.
template <int kTiles>
HWY_INLINE void ApplySets(const float* tiles, int64_t stride, int64_t columns,
                          int64_t sets, const float* column, float* out) {
  int64_t s = 0;
  for (; s + kSets <= sets; s += kSets) {
    Apply<kTiles, kSets>(tiles, stride, columns, sets, column + s * 3, nullptr,
                         out + s * kTileSums);
  }
  if constexpr (kSets > 2) {
    if (s + 2 <= sets) {
      Apply<kTiles, 2>(tiles, stride, columns, sets, column + s * 3, nullptr,
                       out + s * kTileSums);
      s += 2;
    }
  }
  for (; s < sets; ++s) {
    Apply<kTiles, 1>(tiles, stride, columns, sets, column + s * 3, nullptr,
                     out + s * kTileSums);
  }
}

void ApplyTiles(const float* tiles, int64_t count, int64_t columns,
                int64_t sets, const float* column, float* out) {
  const int64_t together = sets == 1 ? kWalks : kTilesOfSets;
  const int64_t stride = count / together;
  for (int64_t t = 0; t < stride; ++t) {
    const float* first = tiles + t * columns * kTilePoints;
    float* sums = out + t * sets * kTileSums;
    if (sets == 1) {
      Apply<kWalks, 1>(first, stride, columns, 1, column, nullptr, sums);
    } else {
      ApplySets<kTilesOfSets>(first, stride, columns, sets, column, sums);
    }
  }
  for (int64_t t = stride * together; t < count; ++t) {
    ApplySets<1>(tiles + t * columns * kTilePoints, 1, columns, sets, column,
                 out + t * sets * kTileSums);
  }
}

void ApplyTilesBeside(const float* base, const float* tiles, int64_t count,
                      int64_t columns, const float* column, float* out) {
  constexpr int kTogether = kPairs < 2 ? 1 : 2;
  // Further ahead: few columns are soon through.
  constexpr int64_t kAhead = 2 * kPrefetchBytes;
  const int64_t stride = count / kTogether;
  for (int64_t t = 0; t < stride; ++t) {
    Apply<kTogether, 1, kAhead>(tiles + t * columns * kTilePoints, stride,
                                columns, 1, column, base + t * kTileSums,
                                out + t * kTileSums);
  }
  for (int64_t t = stride * kTogether; t < count; ++t) {
    Apply<1, 1>(tiles + t * columns * kTilePoints, 1, columns, 1, column,
                base + t * kTileSums, out + t * kTileSums);
  }
}

void AddTileColumns(const float* tiles, int64_t count, int64_t columns,
                    const int32_t* index, int64_t changed, const double* delta,
                    double* out) {
  const hn::Rebind<float, decltype(kDoubles)> halves;
  for (int64_t t = 0; t < count; ++t, out += kTileSums) {
    const float* tile = tiles + t * columns * kTilePoints;
    Doubles sums[3][kDoubleVectors];
    for (int d = 0; d < 3; ++d) {
      for (int v = 0; v < kDoubleVectors; ++v) {
        sums[d][v] =
            hn::LoadU(kDoubles, out + d * kTilePoints + v * kDoubleLanes);
      }
    }
    for (int64_t k = 0; k < changed; ++k) {
      const float* weights =
          tile + (index != nullptr ? int64_t{index[k]} : k) * kTilePoints;
      if (t + 1 < count) hwy::Prefetch(weights + columns * kTilePoints);
      for (int v = 0; v < kDoubleVectors; ++v) {
        const Doubles w = hn::PromoteTo(
            kDoubles, hn::LoadU(halves, weights + v * kDoubleLanes));
        for (int d = 0; d < 3; ++d) {
          sums[d][v] =
              hn::MulAdd(w, hn::Set(kDoubles, delta[k * 3 + d]), sums[d][v]);
        }
      }
    }
    for (int d = 0; d < 3; ++d) {
      for (int v = 0; v < kDoubleVectors; ++v) {
        hn::StoreU(sums[d][v], kDoubles,
                   out + d * kTilePoints + v * kDoubleLanes);
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(ApplyTiles);
HWY_EXPORT(ApplyTilesBeside);
HWY_EXPORT(AddTileColumns);

void ApplyTiles(const float* tiles, int64_t count, int64_t columns,
                int64_t sets, const float* column, float* out) {
  HWY_DYNAMIC_DISPATCH(ApplyTiles)(tiles, count, columns, sets, column, out);
}

void ApplyTilesBeside(const float* base, const float* tiles, int64_t count,
                      int64_t columns, const float* column, float* out) {
  HWY_DYNAMIC_DISPATCH(ApplyTilesBeside)
  (base, tiles, count, columns, column, out);
}

void AddTileColumns(const float* tiles, int64_t count, int64_t columns,
                    const int32_t* index, int64_t changed, const double* delta,
                    double* out) {
  HWY_DYNAMIC_DISPATCH(AddTileColumns)
  (tiles, count, columns, index, changed, delta, out);
}

}  // namespace deform
#endif  // HWY_ONCE
