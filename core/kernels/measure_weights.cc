// One source, compiled by Highway for each instruction set.
#include "core/kernels/measure_weights.h"

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/measure_weights.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<double, kTilePoints> kDoubles;
using Doubles = hn::Vec<decltype(kDoubles)>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kDoubles));

// Of the points of one vector.
struct Sums {
  Doubles position[3];
  Doubles size, total;
  Doubles least, most;
};

// Adds columns [first, last); `tile` and `column` begin at column 0.
HWY_INLINE void Add(const float* HWY_RESTRICT tile,
                    const double* HWY_RESTRICT column, int64_t first,
                    int64_t last, Sums& sums) {
  const hn::Rebind<float, decltype(kDoubles)> halves;
  for (int64_t c = first; c < last; ++c) {
    const Doubles weight =
        hn::PromoteTo(kDoubles, hn::LoadU(halves, tile + c * kTilePoints));
    for (int d = 0; d < 3; ++d) {
      sums.position[d] = hn::MulAdd(
          weight, hn::Set(kDoubles, column[3 * c + d]), sums.position[d]);
    }
    sums.size = sums.size + hn::Abs(weight);
    sums.total = sums.total + weight;
    sums.least = hn::Min(sums.least, weight);
    sums.most = hn::Max(sums.most, weight);
  }
}

void MeasureTile(const float* tile, int64_t columns, int64_t vertices,
                 const double* column, TileMeasures& measures) {
  const Doubles zero = hn::Zero(kDoubles);
  for (int at = 0; at < kTilePoints; at += kLanes) {
    Sums sums = {{zero, zero, zero}, zero, zero, zero, zero};
    if (vertices > 0) {
      const hn::Rebind<float, decltype(kDoubles)> halves;
      sums.least = hn::PromoteTo(kDoubles, hn::LoadU(halves, tile + at));
      sums.most = sums.least;
    }
    Add(tile + at, column, 0, vertices, sums);
    hn::Store(sums.size, kDoubles, measures.vertex_sum + at);
    hn::Store(sums.total, kDoubles, measures.vertex_total + at);
    hn::Store(sums.least, kDoubles, measures.vertex_min + at);
    hn::Store(sums.most, kDoubles, measures.vertex_max + at);
    sums.size = zero;
    Add(tile + at, column, vertices, columns, sums);
    hn::Store(sums.size, kDoubles, measures.normal_sum + at);
    for (int d = 0; d < 3; ++d) {
      hn::Store(sums.position[d], kDoubles, measures.position[d] + at);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(MeasureTile);

void MeasureTile(const float* tile, int64_t columns, int64_t vertices,
                 const double* column, TileMeasures& measures) {
  HWY_DYNAMIC_DISPATCH(MeasureTile)
  (tile, columns, vertices, column, measures);
}

}  // namespace deform
#endif  // HWY_ONCE
