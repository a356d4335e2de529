// One source, compiled by Highway for each instruction set.
#include "core/kernels/map_points.h"

#include <algorithm>

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/map_points.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<double, 8> kDoubles;
constexpr hn::Rebind<float, decltype(kDoubles)> kFloats;
using Doubles = hn::Vec<decltype(kDoubles)>;
using Floats = hn::Vec<decltype(kFloats)>;
constexpr int64_t kLanes = static_cast<int64_t>(hn::MaxLanes(kDoubles));

// As many points as a vector has lanes.
HWY_INLINE void MapSome(const PointMap& map, const double* HWY_RESTRICT rest,
                        const double* HWY_RESTRICT displacements,
                        float* HWY_RESTRICT out) {
  Doubles from[3], by[3];
  hn::LoadInterleaved3(kDoubles, rest, from[0], from[1], from[2]);
  hn::LoadInterleaved3(kDoubles, displacements, by[0], by[1], by[2]);
  for (int k = 0; k < 3; ++k) {
    from[k] = hn::Sub(from[k], hn::Set(kDoubles, map.from[k]));
  }
  Floats placed[3];
  for (int d = 0; d < 3; ++d) {
    const double* const row = map.linear[d];
    Doubles x = hn::Mul(hn::Set(kDoubles, row[0]), from[0]);
    x = hn::MulAdd(hn::Set(kDoubles, row[1]), from[1], x);
    x = hn::MulAdd(hn::Set(kDoubles, row[2]), from[2], x);
    x = hn::Add(x, hn::Set(kDoubles, map.to[d]));
    x = hn::Add(x, by[d]);
    x = hn::Sub(x, hn::Set(kDoubles, map.origin[d]));
    placed[d] = hn::DemoteTo(kFloats, x);
  }
  hn::StoreInterleaved3(placed[0], placed[1], placed[2], kFloats, out);
}

void MapPoints(const PointMap& map, const double* HWY_RESTRICT rest,
               const double* HWY_RESTRICT displacements, int64_t count,
               float* HWY_RESTRICT out) {
  int64_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    MapSome(map, rest + 3 * i, displacements + 3 * i, out + 3 * i);
  }
  if (i == count) return;
  double some_rest[3 * kLanes] = {}, some_displacements[3 * kLanes] = {};
  float placed[3 * kLanes];
  std::copy_n(rest + 3 * i, 3 * (count - i), some_rest);
  std::copy_n(displacements + 3 * i, 3 * (count - i), some_displacements);
  MapSome(map, some_rest, some_displacements, placed);
  std::copy_n(placed, 3 * (count - i), out + 3 * i);
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(MapPoints);

void MapPoints(const PointMap& map, const double* rest,
               const double* displacements, int64_t count, float* out) {
  HWY_DYNAMIC_DISPATCH(MapPoints)
  (map, rest, displacements, count, out);
}

}  // namespace deform
#endif  // HWY_ONCE
