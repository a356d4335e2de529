// The closed form of green_2d.cc, in double: its few edges are not worth float.
//
// One source, compiled by Highway for each instruction set.
#include "core/weights/schemes/green_2d_lanes.h"

#include <cstring>

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/weights/schemes/green_2d_lanes.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
// After foreach_target.h, which reads it once per target.
#include "core/weights/schemes/green_close-inl.h"
#include "core/weights/schemes/lane_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

using Doubles = hn::CappedTag<double, kTilePoints>;
using Lane = hn::Vec<Doubles>;
constexpr Doubles kDoubles;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kDoubles));

// What phi may miss for the closure to be no more than rounding.
constexpr double kMissing = 1e-12;
constexpr double kTurn = 6.283185307179586477;

// An end of edges: vertex - eta, its square, and the square's logarithm in
// model units. As stored, 4 x 16 each.
struct End {
  Lane x, y, square, log;
};

HWY_INLINE End LoadEnd(const double* HWY_RESTRICT from) {
  const Doubles d;
  return {hn::Load(d, from), hn::Load(d, from + kTilePoints),
          hn::Load(d, from + 2 * kTilePoints),
          hn::Load(d, from + 3 * kTilePoints)};
}

// Returns the lanes that touch a vertex.
HWY_INLINE hn::Mask<Doubles> LookAtVertices(const GreenLaneLoops& loops,
                                            const LanePoints& points,
                                            int64_t at,
                                            double* HWY_RESTRICT ends) {
  const Doubles d;
  const Lane one = hn::Set(d, 1);
  Lane least = hn::Set(d, 1e300);
  for (int64_t v = 0; v < loops.vertices; ++v) {
    const double* vertex = loops.vertex + 3 * v;
    double* to = ends + v * 4 * kTilePoints + at;
    const Lane x = hn::Set(d, vertex[0]) - hn::Load(d, points.at[0] + at);
    const Lane y = hn::Set(d, vertex[1]) - hn::Load(d, points.at[1] + at);
    const Lane square = hn::MulAdd(x, x, y * y);
    least = hn::Min(least, square);
    hn::Store(x, d, to);
    hn::Store(y, d, to + kTilePoints);
    hn::Store(square, d, to + 2 * kTilePoints);
    hn::Store(
        LogOfRatio(d, square, one, square - one) + hn::Set(d, loops.log_unit),
        d, to + 3 * kTilePoints);
  }
  return least <= hn::Set(d, loops.touch * loops.touch);
}

// Adds an edge's share to phi and sets its psi. Returns the lanes that touch it
// between its ends.
HWY_INLINE hn::Mask<Doubles> IntegrateEdge(const GreenLaneLoops& loops,
                                           const GreenLaneSegment& edge,
                                           const double* HWY_RESTRICT ends,
                                           double* HWY_RESTRICT phi,
                                           double* HWY_RESTRICT psi) {
  const Doubles d;
  const Lane ax = hn::Set(d, edge.a[0]), ay = hn::Set(d, edge.a[1]);
  const Lane l = hn::Set(d, edge.length);
  const Lane inverse = hn::Set(d, 1 / edge.length);
  const End b1 = LoadEnd(ends + edge.from * 4 * kTilePoints);
  const End b2 = LoadEnd(ends + edge.to * 4 * kTilePoints);
  const auto first = b1.square <= b2.square;  // The closer keeps the digits.
  const Lane nx = hn::IfThenElse(first, b1.x, b2.x);
  const Lane ny = hn::IfThenElse(first, b1.y, b2.y);
  const Lane cross = nx * ay - ny * ax;
  const Lane h = cross * inverse;
  const Lane dot = hn::MulAdd(b1.x, b2.x, b1.y * b2.y);
  const Lane theta = hn::CopySign(AngleOf(d, hn::Abs(cross), dot), cross);
  const Lane x1 = hn::MulAdd(b1.x, ax, b1.y * ay) * inverse;
  const Lane x2 = hn::MulAdd(b2.x, ax, b2.y * ay) * inverse;
  const Lane x = x1 + x2;
  const Lane half = hn::Set(d, 0.5);
  const Lane lg = half * LogOfRatio(d, b2.square, b1.square, l * x);
  const Lane T =
      hn::MulAdd(hn::Set(d, 0.25) * l, b1.log + b2.log, half * x * lg);
  const Lane scale = inverse * hn::Set(d, 1 / kTurn);
  AddTo(d, (x2 * theta - h * lg) * scale, phi + edge.from * kTilePoints);
  AddTo(d, (h * lg - x1 * theta) * scale, phi + edge.to * kTilePoints);
  hn::Store((l - T - h * theta) * hn::Set(d, loops.psi), d, psi);
  return hn::And(hn::Abs(h) <= hn::Set(d, loops.touch), dot <= hn::Zero(d));
}

void InDouble(const GreenLaneLoops& loops, LanePoints& points, void* scratch,
              double* HWY_RESTRICT weights) {
  auto* ends = static_cast<double*>(scratch);
  std::memset(weights, 0, sizeof(double) * kTilePoints * loops.vertices);
  uint32_t lost_lanes = 0;
  for (int64_t at = 0; at < points.count; at += kLanes) {
    auto lost = LookAtVertices(loops, points, at, ends);
    for (int64_t e = 0; e < loops.edges; ++e) {
      double* psi = weights + (loops.vertices + e) * kTilePoints;
      lost = hn::Or(lost, IntegrateEdge(loops, loops.edge[e], ends + at,
                                        weights + at, psi + at));
    }
    lost_lanes |= BitsOf(kDoubles, lost) << at;
  }
  Close(kDoubles, loops.vertices, kMissing, weights, points);
  points.solved &= ~lost_lanes;
}

void InFloat(const GreenLaneLoops& loops, LanePoints& points, void* scratch,
             float* HWY_RESTRICT weights) {
  double* exact =
      static_cast<double*>(scratch) + 4 * kTilePoints * loops.vertices;
  InDouble(loops, points, scratch, exact);
  RoundTile(exact, loops.vertices + loops.edges, points.count, weights);
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(InDouble);
HWY_EXPORT(InFloat);

int64_t Green2dLaneScratch(const GreenLaneLoops& loops) {
  return kTilePoints * (5 * loops.vertices + loops.edges) *
         int64_t{sizeof(double)};
}

void IntegrateGreen2d(const GreenLaneLoops& loops, LanePoints& points,
                      void* scratch, double* weights) {
  HWY_DYNAMIC_DISPATCH(InDouble)(loops, points, scratch, weights);
}

void IntegrateGreen2d(const GreenLaneLoops& loops, LanePoints& points,
                      void* scratch, float* weights) {
  HWY_DYNAMIC_DISPATCH(InFloat)(loops, points, scratch, weights);
}

}  // namespace deform
#endif  // HWY_ONCE
