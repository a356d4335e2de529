// Departs from mean_value.cc: the angle under which an edge is seen, over its
// distance, is all that a face needs of it, and is the same for both its faces.
//
// One source, compiled by Highway for each instruction set.
#include "core/weights/schemes/mean_value_lanes.h"

#include <cstring>

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/weights/schemes/mean_value_lanes.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
// After foreach_target.h, which reads it once per target.
#include "core/weights/schemes/lane_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

using Doubles = hn::CappedTag<double, kTilePoints>;
using Lane = hn::Vec<Doubles>;
using Lanes = hn::Mask<Doubles>;
constexpr Doubles kDoubles;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kDoubles));

// Closer than this part of an edge's length to it, digits are lost.
constexpr double kBesideEdge = 1e-4;

struct End {
  Space<Doubles> a;  // vertex - eta
  Lane r;
};

HWY_INLINE End LoadEnd(const double* HWY_RESTRICT ends, int64_t vertex) {
  const Doubles d;
  const double* from = ends + vertex * 4 * kTilePoints;
  return {{hn::Load(d, from), hn::Load(d, from + kTilePoints),
           hn::Load(d, from + 2 * kTilePoints)},
          hn::Load(d, from + 3 * kTilePoints)};
}

// Writes a and r of all vertices, V x 4 x 16; returns the lanes that touch one.
HWY_INLINE Lanes LookAtVertices(const MeanValueCage& cage,
                                const LanePoints& points, int64_t at,
                                double* HWY_RESTRICT ends) {
  const Doubles d;
  Lane nearest = hn::Set(d, 1e300);
  for (int64_t v = 0; v < cage.vertices; ++v) {
    const double* vertex = cage.vertex + 3 * v;
    double* to = ends + v * 4 * kTilePoints + at;
    const Space<Doubles> a = {
        hn::Set(d, vertex[0]) - hn::Load(d, points.at[0] + at),
        hn::Set(d, vertex[1]) - hn::Load(d, points.at[1] + at),
        hn::Set(d, vertex[2]) - hn::Load(d, points.at[2] + at)};
    const Lane r = hn::Sqrt(a.Dot(a));
    nearest = hn::Min(nearest, r);
    hn::Store(a.x, d, to);
    hn::Store(a.y, d, to + kTilePoints);
    hn::Store(a.z, d, to + 2 * kTilePoints);
    hn::Store(r, d, to + 3 * kTilePoints);
  }
  return nearest <= hn::Set(d, cage.touch);
}

// --- In the plane.

// Adds the tangents of half the angle under which an edge is seen to both its
// ends. Returns the lanes that touch it between these.
HWY_INLINE Lanes AddTangents(const MeanValueCage& cage,
                             const MeanValueEdge& edge,
                             const double* HWY_RESTRICT ends,
                             double* HWY_RESTRICT weights) {
  const Doubles d;
  const End b1 = LoadEnd(ends, edge.from);
  const End b2 = LoadEnd(ends, edge.to);
  const auto first = b1.r < b2.r;  // The closer keeps the digits.
  const Lane x = hn::IfThenElse(first, b1.a.x, b2.a.x);
  const Lane y = hn::IfThenElse(first, b1.a.y, b2.a.y);
  const Lane cross = x * hn::Set(d, edge.a[1]) - y * hn::Set(d, edge.a[0]);
  const Lane dot = hn::MulAdd(b1.a.x, b2.a.x, b1.a.y * b2.a.y);
  const Lane rr = b1.r * b2.r;
  const auto acute = dot >= hn::Zero(d);
  const Lane tangent = hn::IfThenElse(acute, cross, rr - dot) /
                       hn::IfThenElse(acute, rr + dot, cross);
  AddTo(d, tangent, weights + edge.from * kTilePoints);
  AddTo(d, tangent, weights + edge.to * kTilePoints);
  return hn::AndNot(acute,
                    hn::Abs(cross) <= hn::Set(d, cage.touch * edge.length));
}

HWY_INLINE Lanes SumEdges(const MeanValueCage& cage,
                          const double* HWY_RESTRICT ends,
                          double* HWY_RESTRICT weights) {
  const Doubles d;
  auto lost = NoLane(d);
  for (int64_t e = 0; e < cage.edges; ++e) {
    lost = hn::Or(lost, AddTangents(cage, cage.edge[e], ends, weights));
  }
  for (int64_t v = 0; v < cage.vertices; ++v) {
    double* weight = weights + v * kTilePoints;
    const Lane r = hn::Load(d, ends + (4 * v + 3) * kTilePoints);
    hn::Store(hn::Load(d, weight) / r, d, weight);
  }
  return lost;
}

// --- In space.

// The angle under which an edge is seen over its distance: E x 16. Returns the
// lanes that are on an edge's line, or next to it between its ends.
HWY_INLINE Lanes LookAtEdges(const MeanValueCage& cage,
                             const double* HWY_RESTRICT ends,
                             double* HWY_RESTRICT angles) {
  const Doubles d;
  auto lost = NoLane(d);
  for (int64_t e = 0; e < cage.edges; ++e) {
    const MeanValueEdge& edge = cage.edge[e];
    const End a = LoadEnd(ends, edge.from);
    const End b = LoadEnd(ends, edge.to);
    const auto first = a.r < b.r;  // The closer keeps the digits.
    const Lane x = hn::IfThenElse(first, a.a.x, b.a.x);
    const Lane y = hn::IfThenElse(first, a.a.y, b.a.y);
    const Lane z = hn::IfThenElse(first, a.a.z, b.a.z);
    const Lane ex = hn::Set(d, edge.a[0]), ey = hn::Set(d, edge.a[1]);
    const Lane ez = hn::Set(d, edge.a[2]);
    const Space<Doubles> cross = {y * ez - z * ey, z * ex - x * ez,
                                  x * ey - y * ex};
    const Lane area = hn::Sqrt(cross.Dot(cross));  // length x distance
    const Lane dot = a.a.Dot(b.a);
    const Lane angle = AngleOf(d, area, dot);
    hn::Store(angle * hn::Set(d, edge.length) / area, d,
              angles + e * kTilePoints);
    const auto beside =
        area <= hn::Set(d, kBesideEdge * edge.length * edge.length);
    lost = hn::Or(
        lost, hn::Or(hn::And(beside, dot < hn::Zero(d)), area == hn::Zero(d)));
  }
  return lost;
}

// Adds a face's share but to lanes that see it edge on, which are returned.
// Lanes that touch it are added to `lost`.
HWY_INLINE Lanes AddFace(const MeanValueCage& cage, const MeanValueFace& face,
                         double edge_on, const double* HWY_RESTRICT ends,
                         const double* HWY_RESTRICT angles,
                         double* HWY_RESTRICT weights, Lanes& lost) {
  const Doubles d;
  const End ends_of[] = {LoadEnd(ends, face.corner[0]),
                         LoadEnd(ends, face.corner[1]),
                         LoadEnd(ends, face.corner[2])};
  Lane angle[3];
  for (int q = 0; q < 3; ++q) {
    angle[q] = hn::Load(d, angles + face.edge[q] * kTilePoints);
  }
  const Lane size = hn::Max(ends_of[0].r, hn::Max(ends_of[1].r, ends_of[2].r));
  const Lane h = ends_of[0].a.Dot(d, face.normal);
  Lane distance[3];
  Lane sum = hn::Zero(d);
  Lane least = hn::Set(d, 1e300);
  for (int q = 0; q < 3; ++q) {
    distance[q] = ends_of[(q + 1) % 3].a.Dot(d, face.m[q]);
    sum = hn::MulAdd(angle[q], distance[q], sum);
    least = hn::Min(least, distance[q]);
  }
  sum = sum / h;
  const Lane height = hn::Abs(h);
  const auto over = least > hn::Zero(d);
  lost = hn::Or(lost, hn::And(over, height <= hn::Set(d, cage.touch)));
  // Over the face all terms of the sum are positive; beside it, close to its
  // plane, they cancel.
  const auto skew = hn::AndNot(over, height < hn::Set(d, edge_on) * size);
  for (int q = 0; q < 3; ++q) {
    const int p1 = (q + 1) % 3, p2 = (q + 2) % 3;
    const Lane across = hn::MulAdd(
        hn::Set(d, face.cosine[p2]), angle[p1],
        hn::MulAdd(hn::Set(d, face.cosine[p1]), angle[p2], angle[q]));
    const Lane share = hn::MulAdd(distance[q], sum, h * across) *
                       hn::Set(d, face.inverse_height[q]);
    AddTo(d, hn::IfThenZeroElse(skew, share),
          weights + face.corner[q] * kTilePoints);
  }
  return skew;
}

void Sum(const MeanValueCage& cage, LanePoints& points, double edge_on,
         void* scratch, double* HWY_RESTRICT weights,
         uint32_t* HWY_RESTRICT skew) {
  auto* ends = static_cast<double*>(scratch);
  double* angles = ends + 4 * kTilePoints * cage.vertices;
  std::memset(weights, 0, sizeof(double) * kTilePoints * cage.vertices);
  std::memset(skew, 0, sizeof(uint32_t) * cage.faces);
  uint32_t lost_lanes = 0;
  for (int64_t at = 0; at < points.count; at += kLanes) {
    auto lost = LookAtVertices(cage, points, at, ends);
    if (cage.faces == 0) {
      lost = hn::Or(lost, SumEdges(cage, ends + at, weights + at));
    } else {
      lost = hn::Or(lost, LookAtEdges(cage, ends + at, angles + at));
    }
    for (int64_t f = 0; f < cage.faces; ++f) {
      const Lanes skewed = AddFace(cage, cage.face[f], edge_on, ends + at,
                                   angles + at, weights + at, lost);
      skew[f] |= BitsOf(kDoubles, skewed) << at;
    }
    lost_lanes |= BitsOf(kDoubles, lost) << at;
  }
  points.solved = ~lost_lanes;
}

void Normalise(const MeanValueCage& cage, LanePoints& points, double tolerance,
               double* HWY_RESTRICT weights) {
  const Doubles d;
  uint32_t exact = 0;
  points.inside = 0;
  for (int64_t at = 0; at < points.count; at += kLanes) {
    const Lane x = hn::Load(d, points.at[0] + at);
    const Lane y = hn::Load(d, points.at[1] + at);
    const Lane z = hn::Load(d, points.at[2] + at);
    Lane sum = hn::Zero(d);
    Space<Doubles> off = {sum, sum, sum};
    for (int64_t v = 0; v < cage.vertices; ++v) {
      const double* vertex = cage.vertex + 3 * v;
      const Lane weight = hn::Load(d, weights + v * kTilePoints + at);
      sum = sum + weight;
      off.x = hn::MulAdd(weight, hn::Set(d, vertex[0]) - x, off.x);
      off.y = hn::MulAdd(weight, hn::Set(d, vertex[1]) - y, off.y);
      off.z = hn::MulAdd(weight, hn::Set(d, vertex[2]) - z, off.z);
    }
    const Lane scale = hn::Set(d, 1) / sum;
    for (int64_t v = 0; v < cage.vertices; ++v) {
      double* weight = weights + v * kTilePoints + at;
      hn::Store(hn::Load(d, weight) * scale, d, weight);
    }
    const Lane error = hn::Sqrt(off.Dot(off)) * hn::Abs(scale);
    exact |= BitsOf(d, error <= hn::Set(d, tolerance * cage.size)) << at;
    points.inside |= BitsOf(d, sum > hn::Zero(d)) << at;
  }
  points.solved &= exact;
}

void NormaliseAndRound(const MeanValueCage& cage, LanePoints& points,
                       double tolerance, double* HWY_RESTRICT weights,
                       float* HWY_RESTRICT rounded) {
  Normalise(cage, points, tolerance, weights);
  RoundTile(weights, cage.vertices, points.count, rounded);
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(Sum);
HWY_EXPORT(Normalise);
HWY_EXPORT(NormaliseAndRound);

int64_t MeanValueScratch(const MeanValueCage& cage) {
  return kTilePoints * (4 * cage.vertices + cage.edges) *
         int64_t{sizeof(double)};
}

void SumMeanValues(const MeanValueCage& cage, LanePoints& points,
                   double edge_on, void* scratch, double* weights,
                   uint32_t* skew) {
  HWY_DYNAMIC_DISPATCH(Sum)(cage, points, edge_on, scratch, weights, skew);
}

void NormaliseMeanValues(const MeanValueCage& cage, LanePoints& points,
                         double tolerance, double* weights) {
  HWY_DYNAMIC_DISPATCH(Normalise)(cage, points, tolerance, weights);
}

void NormaliseMeanValues(const MeanValueCage& cage, LanePoints& points,
                         double tolerance, double* weights, float* rounded) {
  HWY_DYNAMIC_DISPATCH(NormaliseAndRound)
  (cage, points, tolerance, weights, rounded);
}

}  // namespace deform
#endif  // HWY_ONCE
