// One source, compiled by Highway for each instruction set.
#include "core/kernels/grid_blocks.h"

#include <cstring>

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/grid_blocks.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<int32_t, 16> kInts;
constexpr hn::RebindToUnsigned<decltype(kInts)> kWords;
using Ints = hn::Vec<decltype(kInts)>;
using Words = hn::Vec<decltype(kWords)>;
constexpr int64_t kLanes = static_cast<int64_t>(hn::MaxLanes(kInts));
constexpr int64_t kPlaneBytes = kGridGroup / 8;

// Vectors of doubles, and half as long ones of what becomes of them.
constexpr hn::CappedTag<double, 8> kDoubles;
constexpr hn::Rebind<float, decltype(kDoubles)> kHalfFloats;
constexpr hn::Rebind<int32_t, decltype(kDoubles)> kHalfInts;
constexpr int64_t kHalfLanes = static_cast<int64_t>(hn::MaxLanes(kDoubles));

bool RoundToGrid(const float* HWY_RESTRICT x, double per_step, double limit,
                 int32_t* HWY_RESTRICT grid) {
  const auto scale = hn::Set(kDoubles, per_step);
  const auto most = hn::Set(kDoubles, limit);
  auto within = hn::Eq(scale, scale);
  for (int64_t i = 0; i < kGridBlock; i += kHalfLanes) {
    const auto steps =
        hn::Mul(hn::PromoteTo(kDoubles, hn::LoadU(kHalfFloats, x + i)), scale);
    const auto fits = hn::Le(hn::Abs(steps), most);
    within = hn::And(within, fits);
    // What is no number is none that can be converted.
    const auto rounded = hn::Round(hn::IfThenElseZero(fits, steps));
    hn::StoreU(hn::DemoteTo(kHalfInts, rounded), kHalfInts, grid + i);
  }
  return hn::AllTrue(kDoubles, within);
}

void LeaveGrid(const int32_t* HWY_RESTRICT grid, double step,
               float* HWY_RESTRICT x) {
  const auto scale = hn::Set(kDoubles, step);
  for (int64_t i = 0; i < kGridBlock; i += kHalfLanes) {
    const auto steps = hn::PromoteTo(kDoubles, hn::LoadU(kHalfInts, grid + i));
    hn::StoreU(hn::DemoteTo(kHalfFloats, hn::Mul(steps, scale)), kHalfFloats,
               x + i);
  }
}

HWY_INLINE Ints Load(const int32_t* numbers) {
  return hn::LoadU(kInts, numbers);
}

// x, or its bitwise inverse if it is negative.
HWY_INLINE Words Magnitude(Ints x) {
  return hn::BitCast(kWords, hn::Xor(x, hn::ShiftRight<31>(x)));
}

HWY_INLINE uint32_t OrOfLanes(Words x) {
  uint32_t lanes[kLanes];
  hn::StoreU(x, kWords, lanes);
  uint32_t all = 0;
  for (const uint32_t lane : lanes) all |= lane;
  return all;
}

HWY_INLINE int32_t SumOfLanes(Ints x) {
  return hn::GetLane(hn::SumOfLanes(kInts, x));
}

void MeasureExtent(const GridBlock& reference, const GridBlock& grid,
                   GridExtent& extent) {
  for (int d = 0; d < 3; ++d) {
    const int32_t* HWY_RESTRICT a = reference.of[d];
    const int32_t* HWY_RESTRICT q = grid.of[d];
    const Ints a0 = hn::Set(kInts, a[0]);
    const Ints e0 = hn::Sub(hn::Set(kInts, q[0]), a0);
    Words place = hn::Zero(kWords), motion = hn::Zero(kWords);
    for (int64_t i = 0; i < kGridBlock; i += kLanes) {
      const Ints ai = Load(a + i);
      const Ints e = hn::Sub(Load(q + i), ai);
      place = hn::Or(place, Magnitude(hn::Sub(ai, a0)));
      motion = hn::Or(motion, Magnitude(hn::Sub(e, e0)));
    }
    extent.place[d] = OrOfLanes(place);
    extent.motion[d] = OrOfLanes(motion);
  }
}

void SumMoments(const GridBlock& reference, const GridBlock& grid,
                int place_shift, const int (&motion_shift)[3],
                GridMoments& sums) {
  Ints places[3], motions[3], place_products[6], motion_products[3][3];
  for (int d = 0; d < 3; ++d) {
    places[d] = motions[d] = hn::Zero(kInts);
    place_products[d] = place_products[d + 3] = hn::Zero(kInts);
    for (int k = 0; k < 3; ++k) motion_products[d][k] = hn::Zero(kInts);
  }
  for (int64_t i = 0; i < kGridBlock; i += kLanes) {
    Ints place[3];
    for (int k = 0; k < 3; ++k) {
      const int32_t* a = reference.of[k];
      place[k] = hn::ShiftRightSame(hn::Sub(Load(a + i), hn::Set(kInts, a[0])),
                                    place_shift);
      places[k] = hn::Add(places[k], place[k]);
    }
    for (int k = 0, at = 0; k < 3; ++k) {
      for (int l = k; l < 3; ++l, ++at) {
        place_products[at] =
            hn::Add(place_products[at], hn::Mul(place[k], place[l]));
      }
    }
    for (int d = 0; d < 3; ++d) {
      const int32_t* a = reference.of[d];
      const int32_t* q = grid.of[d];
      const Ints e = hn::Sub(Load(q + i), Load(a + i));
      const Ints e0 = hn::Sub(hn::Set(kInts, q[0]), hn::Set(kInts, a[0]));
      const Ints motion = hn::ShiftRightSame(hn::Sub(e, e0), motion_shift[d]);
      motions[d] = hn::Add(motions[d], motion);
      for (int k = 0; k < 3; ++k) {
        motion_products[d][k] =
            hn::Add(motion_products[d][k], hn::Mul(motion, place[k]));
      }
    }
  }
  for (int d = 0, at = 0; d < 3; ++d) {
    sums.places[d] = SumOfLanes(places[d]);
    sums.motions[d] = SumOfLanes(motions[d]);
    for (int k = d; k < 3; ++k, ++at) {
      sums.place_products[d][k] = SumOfLanes(place_products[at]);
    }
    for (int k = 0; k < 3; ++k) {
      sums.motion_products[d][k] = SumOfLanes(motion_products[d][k]);
    }
  }
}

// The prediction of coordinate d, vector by vector: body(i, predicted).
template <typename Body>
HWY_INLINE void Predict(const GridBlock& reference, int d,
                        const GridPrediction& prediction, Body body) {
  const Ints offset = hn::Set(kInts, prediction.offset);
  const int32_t* HWY_RESTRICT a = reference.of[d];
  if ((prediction.gradient[0] | prediction.gradient[1] |
       prediction.gradient[2]) == 0) {
    for (int64_t i = 0; i < kGridBlock; i += kLanes) {
      body(i, hn::Add(Load(a + i), offset));
    }
    return;
  }
  const auto half = static_cast<int32_t>((1U << prediction.fraction) >> 1);
  for (int64_t i = 0; i < kGridBlock; i += kLanes) {
    Ints sum = hn::Set(kInts, half);
    for (int k = 0; k < 3; ++k) {
      const int32_t* of_k = reference.of[k];
      const Ints place = hn::ShiftRightSame(
          hn::Sub(Load(of_k + i), hn::Set(kInts, of_k[0])), prediction.shift);
      sum =
          hn::Add(sum, hn::Mul(hn::Set(kInts, prediction.gradient[k]), place));
    }
    const Ints linear = hn::ShiftRightSame(sum, prediction.fraction);
    body(i, hn::Add(hn::Add(Load(a + i), offset), linear));
  }
}

void FoldResiduals(const GridBlock& reference, int d, const int32_t* grid,
                   const GridPrediction& prediction, uint32_t* folded) {
  Predict(reference, d, prediction, [&](int64_t i, Ints predicted) HWY_ATTR {
    const Ints left = hn::Sub(Load(grid + i), predicted);
    hn::StoreU(hn::BitCast(kWords, hn::Xor(hn::ShiftLeft<1>(left),
                                           hn::ShiftRight<31>(left))),
               kWords, folded + i);
  });
}

void AddResiduals(const GridBlock& reference, int d, const uint32_t* folded,
                  const GridPrediction& prediction, int32_t* grid) {
  Predict(reference, d, prediction, [&](int64_t i, Ints predicted) HWY_ATTR {
    const Words word = hn::LoadU(kWords, folded + i);
    const Ints sign = hn::Neg(
        hn::BitCast(kInts, hn::And(word, hn::Set(kWords, uint32_t{1}))));
    const Ints left =
        hn::Xor(hn::BitCast(kInts, hn::ShiftRight<1>(word)), sign);
    hn::StoreU(hn::Add(predicted, left), kInts, grid + i);
  });
}

void PackBits(const uint32_t* values, int bits, uint8_t* out) {
  uint8_t mask_bytes[8] = {};
  for (int k = 0; k < bits; ++k) {
    const Words bit = hn::Set(kWords, uint32_t{1} << k);
    uint8_t* const plane = out + k * kPlaneBytes;
    for (int64_t i = 0; i < kGridGroup; i += kLanes) {
      const auto mask = hn::TestBit(hn::LoadU(kWords, values + i), bit);
      hn::StoreMaskBits(kWords, mask, mask_bytes);
      if constexpr (kLanes >= 8) {
        std::memcpy(plane + i / 8, mask_bytes, kLanes / 8);
      } else if (i % 8 == 0) {
        plane[i / 8] = mask_bytes[0];
      } else {
        plane[i / 8] |= mask_bytes[0] << (i % 8);
      }
    }
  }
}

void UnpackBits(const uint8_t* planes, int bits, uint32_t* values) {
  // LoadMaskBits() reads 8 bytes wherever it is told to.
  uint8_t copy[33 * kPlaneBytes] = {};
  std::memcpy(copy, planes, bits * kPlaneBytes);
  for (int64_t i = 0; i < kGridGroup; i += kLanes) {
    Words value = hn::Zero(kWords);
    for (int k = 0; k < bits; ++k) {
      const uint8_t* from = copy + k * kPlaneBytes + i / 8;
      uint8_t shifted[8] = {};
      if constexpr (kLanes < 8) {
        shifted[0] = static_cast<uint8_t>(*from >> (i % 8));
        from = shifted;
      }
      const auto mask = hn::LoadMaskBits(kWords, from);
      value = hn::Or(
          value, hn::IfThenElseZero(mask, hn::Set(kWords, uint32_t{1} << k)));
    }
    hn::StoreU(value, kWords, values + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(RoundToGrid);
HWY_EXPORT(LeaveGrid);
HWY_EXPORT(MeasureExtent);
HWY_EXPORT(SumMoments);
HWY_EXPORT(FoldResiduals);
HWY_EXPORT(AddResiduals);
HWY_EXPORT(PackBits);
HWY_EXPORT(UnpackBits);

bool RoundToGrid(const float* x, double per_step, double limit, int32_t* grid) {
  return HWY_DYNAMIC_DISPATCH(RoundToGrid)(x, per_step, limit, grid);
}

void LeaveGrid(const int32_t* grid, double step, float* x) {
  HWY_DYNAMIC_DISPATCH(LeaveGrid)(grid, step, x);
}

GridExtent MeasureExtent(const GridBlock& reference, const GridBlock& grid) {
  GridExtent extent;
  HWY_DYNAMIC_DISPATCH(MeasureExtent)(reference, grid, extent);
  return extent;
}

GridMoments SumMoments(const GridBlock& reference, const GridBlock& grid,
                       int place_shift, const int (&motion_shift)[3]) {
  GridMoments sums = {};
  HWY_DYNAMIC_DISPATCH(SumMoments)
  (reference, grid, place_shift, motion_shift, sums);
  return sums;
}

void FoldResiduals(const GridBlock& reference, int d, const int32_t* grid,
                   const GridPrediction& prediction, uint32_t* folded) {
  HWY_DYNAMIC_DISPATCH(FoldResiduals)(reference, d, grid, prediction, folded);
}

void AddResiduals(const GridBlock& reference, int d, const uint32_t* folded,
                  const GridPrediction& prediction, int32_t* grid) {
  HWY_DYNAMIC_DISPATCH(AddResiduals)(reference, d, folded, prediction, grid);
}

void PackBits(const uint32_t* values, int bits, uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(PackBits)(values, bits, out);
}

void UnpackBits(const uint8_t* planes, int bits, uint32_t* values) {
  HWY_DYNAMIC_DISPATCH(UnpackBits)(planes, bits, values);
}

}  // namespace deform
#endif  // HWY_ONCE
