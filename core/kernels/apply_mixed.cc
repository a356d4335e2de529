// One source, compiled by Highway for each instruction set.
#include "core/kernels/apply_mixed.h"

#include "core/kernels/apply_weights.h"

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/apply_mixed.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<float, kTilePoints> kFloats;
using Floats = hn::Vec<decltype(kFloats)>;
constexpr int64_t kLanes = static_cast<int64_t>(hn::MaxLanes(kFloats));
// Vectors of points whose sums, 12 registers, stay in registers.
constexpr int kVectors = 4;
constexpr int64_t kGroupPoints = kVectors * kLanes;

HWY_INLINE Floats Load(const float* numbers) {
  return hn::LoadU(kFloats, numbers);
}

// int16 or int8.
template <typename Number>
HWY_INLINE Floats Load(const Number* numbers) {
  const hn::Rebind<Number, decltype(kFloats)> narrow;
  const hn::Rebind<int32_t, decltype(kFloats)> wide;
  return hn::ConvertTo(kFloats,
                       hn::PromoteTo(wide, hn::LoadU(narrow, numbers)));
}

// Adds `count` columns of one kind; `numbers` points to the group's first.
template <typename Number>
HWY_INLINE void Add(const Number* HWY_RESTRICT numbers, int64_t count,
                    const float* HWY_RESTRICT column,
                    Floats (&sums)[3][kVectors]) {
  for (int64_t k = 0; k < count; ++k) {
    const Floats x = hn::Set(kFloats, column[k * 3]);
    const Floats y = hn::Set(kFloats, column[k * 3 + 1]);
    const Floats z = hn::Set(kFloats, column[k * 3 + 2]);
    for (int v = 0; v < kVectors; ++v) {
      const Floats number = Load(numbers + k * kBlockPoints + v * kLanes);
      sums[0][v] = hn::MulAdd(number, x, sums[0][v]);
      sums[1][v] = hn::MulAdd(number, y, sums[1][v]);
      sums[2][v] = hn::MulAdd(number, z, sums[2][v]);
    }
  }
}

void ApplyMixed(const std::byte* blocks, int64_t count,
                const MixedColumns& columns, const float* column, float* out) {
  const float* of_floats = column + 3;
  const float* of_shorts = of_floats + columns.floats * 3;
  const float* of_bytes = of_shorts + columns.shorts * 3;
  for (int64_t b = 0; b < count; ++b) {
    const auto* floats =
        reinterpret_cast<const float*>(blocks + b * columns.block_bytes());
    const auto* shorts = reinterpret_cast<const int16_t*>(
        floats + columns.floats * kBlockPoints);
    const auto* bytes =
        reinterpret_cast<const int8_t*>(shorts + columns.shorts * kBlockPoints);
    for (int64_t at = 0; at < kBlockPoints; at += kGroupPoints) {
      Floats sums[3][kVectors];
      for (int d = 0; d < 3; ++d) {
        for (Floats& sum : sums[d]) sum = hn::Set(kFloats, column[d]);
      }
      Add(floats + at, columns.floats, of_floats, sums);
      Add(shorts + at, columns.shorts, of_shorts, sums);
      Add(bytes + at, columns.bytes, of_bytes, sums);
      for (int v = 0; v < kVectors; ++v) {
        const int64_t point = b * kBlockPoints + at + v * kLanes;
        float* tile = out + point / kTilePoints * kTileSums;
        for (int d = 0; d < 3; ++d) {
          hn::StoreU(sums[d][v], kFloats,
                     tile + d * kTilePoints + point % kTilePoints);
        }
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(ApplyMixed);

void ApplyMixed(const std::byte* blocks, int64_t count,
                const MixedColumns& columns, const float* column, float* out) {
  HWY_DYNAMIC_DISPATCH(ApplyMixed)(blocks, count, columns, column, out);
}

}  // namespace deform
#endif  // HWY_ONCE
