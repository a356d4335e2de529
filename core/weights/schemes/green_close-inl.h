// The closure of Green coordinates for lanes that are not close to the cage,
// where what is missing is rounding. Included by the lane kernels, once for
// each instruction set.

#if defined(DEFORM_CORE_WEIGHTS_SCHEMES_GREEN_CLOSE_INL_H_) == \
    defined(HWY_TARGET_TOGGLE)
#ifdef DEFORM_CORE_WEIGHTS_SCHEMES_GREEN_CLOSE_INL_H_
#undef DEFORM_CORE_WEIGHTS_SCHEMES_GREEN_CLOSE_INL_H_
#else
#define DEFORM_CORE_WEIGHTS_SCHEMES_GREEN_CLOSE_INL_H_
#endif

#include "core/weights/schemes/lane_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

// Spreads what the sum of phi (V x 16) misses over all vertices. Lanes that
// miss no more than `missing` are solved.
template <class D>
HWY_INLINE void Close(D d, int64_t vertices, double missing,
                      hn::TFromD<D>* HWY_RESTRICT phi, LanePoints& points) {
  using T = hn::TFromD<D>;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d));
  points.solved = points.inside = 0;
  for (int64_t at = 0; at < points.count; at += kLanes) {
    auto sum = hn::Zero(d);
    for (int64_t v = 0; v < vertices; ++v) {
      sum = sum + hn::Load(d, phi + v * kTilePoints + at);
    }
    const auto one = hn::Set(d, T{1});
    const auto inside = sum > hn::Set(d, T{0.5});
    const auto missed = hn::IfThenElseZero(inside, one) - sum;
    const auto spread = missed / hn::Set(d, static_cast<T>(vertices));
    for (int64_t v = 0; v < vertices; ++v) {
      AddTo(d, spread, phi + v * kTilePoints + at);
    }
    const auto solved = hn::Abs(missed) <= hn::Set(d, static_cast<T>(missing));
    points.solved |= BitsOf(d, solved) << at;
    points.inside |= BitsOf(d, inside) << at;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#endif  // DEFORM_CORE_WEIGHTS_SCHEMES_GREEN_CLOSE_INL_H_
