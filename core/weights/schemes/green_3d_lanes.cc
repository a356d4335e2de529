// The closed form of green_3d.cc, without its care for what is close: one
// logarithm an edge and one angle a face. Far away, as most of a cage is, it
// loses nothing to float but float's own rounding: phi of a face is a share of
// its solid angle, so that all of them together come to about 1, and within
// one face terms of that size cancel.
//
// One source, compiled by Highway for each instruction set.
#include "core/weights/schemes/green_3d_lanes.h"

#include <cstring>

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/weights/schemes/green_3d_lanes.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
// After foreach_target.h, which reads it once per target.
#include "core/weights/schemes/green_close-inl.h"
#include "core/weights/schemes/lane_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

using Floats = hn::CappedTag<float, kTilePoints>;
using Doubles = hn::CappedTag<double, kTilePoints>;
// As many as make half a vector of floats.
using NearDoubles = hn::CappedTag<
    double, (hn::MaxLanes(Floats()) > 1 ? hn::MaxLanes(Floats()) / 2 : 1)>;
using HalfFloats = hn::Rebind<float, NearDoubles>;

// An edge l is far if it is shorter than this times the sum of its ends'
// distances r: from its middle l * 0.44 away.
constexpr float kFar = 0.75f;
// If more than one face in so many is near, all might as well be in double.
constexpr int64_t kMostlyNear = 4;
// Beyond so many diagonals of the cage, squares and cubes leave float.
constexpr float kFarthest = 1e4f;
// r + r - l in units of l: next to the edge, where digits are lost: closer than
// 1e-3 l to its middle.
constexpr double kBesideEdge = 2e-6;
// |det| + |den| in units of rrr, where both have lost their digits.
constexpr double kLostAngle = 1e-3;
// What phi may miss for the closure to be no more than rounding.
constexpr double kMissing = 1e-12;
constexpr double kMissingFloat = 4e-6;

// Doubles that a tile in double needs besides its weights.
HWY_INLINE int64_t DoubleScratch(const GreenLaneCage& cage) {
  return kTilePoints * (4 * cage.vertices + cage.edges);
}

template <class D>
struct Corner {
  Space<D> a;    // vertex - eta
  hn::Vec<D> r;  // |a|
};

template <class D>
HWY_INLINE Corner<D> LoadCorner(D d, const hn::TFromD<D>* HWY_RESTRICT seen,
                                int64_t vertex, int64_t at) {
  const hn::TFromD<D>* from = seen + vertex * 4 * kTilePoints + at;
  return {{hn::Load(d, from), hn::Load(d, from + kTilePoints),
           hn::Load(d, from + 2 * kTilePoints)},
          hn::Load(d, from + 3 * kTilePoints)};
}

HWY_INLINE Space<NearDoubles> Seen(const double* vertex,
                                   const LanePoints& points, int64_t at) {
  const NearDoubles d;
  return {hn::Set(d, vertex[0]) - hn::Load(d, points.at[0] + at),
          hn::Set(d, vertex[1]) - hn::Load(d, points.at[1] + at),
          hn::Set(d, vertex[2]) - hn::Load(d, points.at[2] + at)};
}

HWY_INLINE Corner<NearDoubles> SeeCorner(const double* vertex,
                                         const LanePoints& points, int64_t at) {
  const Space<NearDoubles> a = Seen(vertex, points, at);
  return {a, hn::Sqrt(a.Dot(a))};
}

// Integral of 1 / distance along an edge of `length` whose ends are `sum` away.
template <class D>
HWY_INLINE hn::Vec<D> EdgeLogarithm(D d, hn::Vec<D> sum, hn::Vec<D> length) {
  return LogOfRatio(d, sum + length, sum - length, length + length);
}

template <class D>
struct FaceShare {
  HWY_INLINE FaceShare() {}

  hn::Vec<D> phi[3];
  hn::Vec<D> psi;
  hn::Mask<D> lost;  // Not set in float, where faces are far.
};

template <class D>
HWY_INLINE FaceShare<D> IntegrateFace(D d,
                                      const GreenLaneFace<hn::TFromD<D>>& face,
                                      const Corner<D> (&c)[3],
                                      const hn::Vec<D> (&log)[3],
                                      hn::TFromD<D> touch) {
  using T = hn::TFromD<D>;
  using V = hn::Vec<D>;
  const V h = c[0].a.Dot(d, face.normal);
  const V rrr = c[0].r * c[1].r * c[2].r;
  const V den =
      hn::MulAdd(c[0].a.Dot(c[1].a), c[2].r,
                 hn::MulAdd(c[1].a.Dot(c[2].a), c[0].r,
                            hn::MulAdd(c[2].a.Dot(c[0].a), c[1].r, rrr)));
  const V det = hn::Set(d, face.area2) * hn::Abs(h);
  const V half = AngleOf(d, det, den);
  const V omega = hn::CopySign(half + half, h);
  FaceShare<D> share;
  V flux = hn::Neg(h) * omega;
  for (int q = 0; q < 3; ++q) {
    const int p1 = (q + 1) % 3, p2 = (q + 2) % 3;
    const V distance = c[p1].a.Dot(d, face.m[q]);
    const V logs =
        hn::MulAdd(hn::Set(d, face.cosine[p2]), log[p1],
                   hn::MulAdd(hn::Set(d, face.cosine[p1]), log[p2], log[q]));
    share.phi[q] =
        hn::Set(d, face.phi[q]) * hn::MulAdd(distance, omega, h * logs);
    flux = hn::MulAdd(distance, log[q], flux);
  }
  share.psi = flux * hn::Set(d, face.psi);
  if constexpr (sizeof(T) == sizeof(double)) {
    const auto lost = det + hn::Abs(den) < hn::Set(d, kLostAngle) * rrr;
    const auto touching =
        hn::And(hn::Abs(h) <= hn::Set(d, touch), den < hn::Zero(d));
    share.lost = hn::Or(lost, touching);
  }
  return share;
}

// --- In double.

// a and r of all vertices for the points from `at` on: V x 4 x 16.
HWY_INLINE void LookInDouble(const GreenLaneCage& cage,
                             const LanePoints& points, int64_t at,
                             double* HWY_RESTRICT seen) {
  const Doubles d;
  for (int64_t v = 0; v < cage.vertices; ++v, seen += 4 * kTilePoints) {
    const double* vertex = cage.vertex + 3 * v;
    const Space<Doubles> a = {
        hn::Set(d, vertex[0]) - hn::Load(d, points.at[0] + at),
        hn::Set(d, vertex[1]) - hn::Load(d, points.at[1] + at),
        hn::Set(d, vertex[2]) - hn::Load(d, points.at[2] + at)};
    hn::Store(a.x, d, seen + at);
    hn::Store(a.y, d, seen + at + kTilePoints);
    hn::Store(a.z, d, seen + at + 2 * kTilePoints);
    hn::Store(hn::Sqrt(a.Dot(a)), d, seen + at + 3 * kTilePoints);
  }
}

void InDouble(const GreenLaneCage& cage, LanePoints& points, void* scratch,
              double* HWY_RESTRICT weights) {
  const Doubles d;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d));
  double* seen = static_cast<double*>(scratch);
  double* logs = seen + 4 * kTilePoints * cage.vertices;
  std::memset(weights, 0, sizeof(double) * kTilePoints * cage.vertices);
  uint32_t lost_lanes = 0;
  for (int64_t at = 0; at < points.count; at += kLanes) {
    LookInDouble(cage, points, at, seen);
    auto lost = NoLane(d);
    for (int64_t e = 0; e < cage.edges; ++e) {
      const GreenLaneEdge<double>& edge = cage.edge[e];
      const double* r = seen + 3 * kTilePoints + at;
      const auto sum = hn::Load(d, r + edge.from * 4 * kTilePoints) +
                       hn::Load(d, r + edge.to * 4 * kTilePoints);
      const auto length = hn::Set(d, edge.length);
      hn::Store(EdgeLogarithm(d, sum, length), d, logs + e * kTilePoints + at);
      lost = hn::Or(lost, sum - length <= hn::Set(d, kBesideEdge) * length);
    }
    for (int64_t f = 0; f < cage.faces; ++f) {
      const GreenLaneFace<double>& face = cage.face[f];
      const Corner<Doubles> corners[] = {
          LoadCorner(d, seen, face.corner[0], at),
          LoadCorner(d, seen, face.corner[1], at),
          LoadCorner(d, seen, face.corner[2], at)};
      hn::Vec<Doubles> log[3];
      for (int q = 0; q < 3; ++q) {
        log[q] = hn::Load(d, logs + face.edge[q] * kTilePoints + at);
      }
      const auto share = IntegrateFace(d, face, corners, log, cage.touch);
      lost = hn::Or(lost, share.lost);
      for (int q = 0; q < 3; ++q) {
        AddTo(d, share.phi[q], weights + face.corner[q] * kTilePoints + at);
      }
      hn::Store(share.psi, d, weights + (cage.vertices + f) * kTilePoints + at);
    }
    lost_lanes |= BitsOf(d, lost) << at;
  }
  Close(d, cage.vertices, kMissing, weights, points);
  points.solved &= ~lost_lanes;
}

// --- Far faces in float.

// a and r of all vertices: V x 4 x 16. Differences are taken in double.
// Returns the lanes that are too far away for float.
HWY_INLINE uint32_t LookInFloat(const GreenLaneCage& cage,
                                const LanePoints& points,
                                float* HWY_RESTRICT seen) {
  const HalfFloats half;
  constexpr int kHalf = static_cast<int>(hn::MaxLanes(half));
  const Floats f;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(f));
  // Two passes: the vectors of the second are those of two of the first.
  for (int64_t v = 0; v < cage.vertices; ++v) {
    float* to = seen + v * 4 * kTilePoints;
    for (int64_t at = 0; at < points.count; at += kHalf) {
      const Space<NearDoubles> a = Seen(cage.vertex + 3 * v, points, at);
      hn::Store(hn::DemoteTo(half, a.x), half, to + at);
      hn::Store(hn::DemoteTo(half, a.y), half, to + at + kTilePoints);
      hn::Store(hn::DemoteTo(half, a.z), half, to + at + 2 * kTilePoints);
    }
  }
  uint32_t too_far = 0;
  for (int64_t at = 0; at < points.count; at += kLanes) {
    auto farthest = hn::Zero(f);
    for (int64_t v = 0; v < cage.vertices; ++v) {
      float* to = seen + v * 4 * kTilePoints + at;
      const Space<Floats> a = {hn::Load(f, to), hn::Load(f, to + kTilePoints),
                               hn::Load(f, to + 2 * kTilePoints)};
      const auto r = hn::Sqrt(a.Dot(a));
      farthest = hn::Max(farthest, r);
      hn::Store(r, f, to + 3 * kTilePoints);
    }
    too_far |= BitsOf(f, hn::Not(farthest <= hn::Set(f, kFarthest))) << at;
  }
  return too_far;
}

// One face in double from its corners on, for the lanes of half a vector of
// floats. Returns the lanes that are lost.
HWY_INLINE uint32_t AddNearFace(const GreenLaneCage& cage, int64_t f,
                                const LanePoints& points, int64_t at,
                                float* HWY_RESTRICT weights) {
  const NearDoubles d;
  const HalfFloats half;
  const GreenLaneFace<double>& face = cage.face[f];
  const Corner<NearDoubles> corners[] = {
      SeeCorner(cage.vertex + 3 * face.corner[0], points, at),
      SeeCorner(cage.vertex + 3 * face.corner[1], points, at),
      SeeCorner(cage.vertex + 3 * face.corner[2], points, at)};
  hn::Vec<NearDoubles> log[3];
  auto lost = NoLane(d);
  for (int q = 0; q < 3; ++q) {
    const auto sum = corners[(q + 1) % 3].r + corners[(q + 2) % 3].r;
    const auto length = hn::Set(d, face.length[q]);
    log[q] = EdgeLogarithm(d, sum, length);
    lost = hn::Or(lost, sum - length <= hn::Set(d, kBesideEdge) * length);
  }
  const auto share = IntegrateFace(d, face, corners, log, cage.touch);
  for (int q = 0; q < 3; ++q) {
    AddTo(half, hn::DemoteTo(half, share.phi[q]),
          weights + face.corner[q] * kTilePoints + at);
  }
  hn::Store(hn::DemoteTo(half, share.psi), half,
            weights + (cage.vertices + f) * kTilePoints + at);
  return BitsOf(d, hn::Or(lost, share.lost)) << at;
}

HWY_INLINE void AddFarFace(const GreenLaneCage& cage, int64_t f,
                           const float* HWY_RESTRICT seen,
                           const float* HWY_RESTRICT logs, int64_t at,
                           float* HWY_RESTRICT weights) {
  const Floats d;
  const GreenLaneFace<float>& face = cage.far_face[f];
  const Corner<Floats> corners[] = {LoadCorner(d, seen, face.corner[0], at),
                                    LoadCorner(d, seen, face.corner[1], at),
                                    LoadCorner(d, seen, face.corner[2], at)};
  hn::Vec<Floats> log[3];
  for (int q = 0; q < 3; ++q) {
    log[q] = hn::Load(d, logs + face.edge[q] * kTilePoints + at);
  }
  const auto share = IntegrateFace(d, face, corners, log, 0.0f);
  for (int q = 0; q < 3; ++q) {
    AddTo(d, share.phi[q], weights + face.corner[q] * kTilePoints + at);
  }
  hn::Store(share.psi, d, weights + (cage.vertices + f) * kTilePoints + at);
}

// Integral of 1 / distance along all edges, E x 16. near[e] is set if an edge
// is not far from all lanes.
HWY_INLINE void LookAtFarEdges(const GreenLaneCage& cage,
                               const float* HWY_RESTRICT seen,
                               float* HWY_RESTRICT logs,
                               uint8_t* HWY_RESTRICT near) {
  const Floats d;
  for (int64_t e = 0; e < cage.edges; ++e) {
    const GreenLaneEdge<float>& edge = cage.far_edge[e];
    const float* r = seen + 3 * kTilePoints;
    const auto sum = hn::Load(d, r + edge.from * 4 * kTilePoints) +
                     hn::Load(d, r + edge.to * 4 * kTilePoints);
    const auto length = hn::Set(d, edge.length);
    hn::Store(EdgeLogarithm(d, sum, length), d, logs + e * kTilePoints);
    near[e] = !hn::AllTrue(d, length < hn::Set(d, kFar) * sum);
  }
}

HWY_INLINE bool IsNear(const GreenLaneCage& cage, int64_t f,
                       const uint8_t* near) {
  const int32_t* edge = cage.far_face[f].edge;
  return (cage.thin[f] | near[edge[0]] | near[edge[1]] | near[edge[2]]) != 0;
}

void InFloat(const GreenLaneCage& cage, LanePoints& points, void* scratch,
             float* HWY_RESTRICT weights) {
  const Floats d;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d));
  constexpr int kHalf = static_cast<int>(hn::MaxLanes(NearDoubles()));
  float* seen = static_cast<float*>(scratch);
  float* logs = seen + 4 * kTilePoints * cage.vertices;
  auto* near = reinterpret_cast<uint8_t*>(logs + kTilePoints * cage.edges);
  std::memset(weights, 0, sizeof(float) * kTilePoints * cage.vertices);
  uint32_t lost = LookInFloat(cage, points, seen);
  for (int64_t at = 0; at < points.count; at += kLanes) {
    LookAtFarEdges(cage, seen + at, logs + at, near);
    int64_t near_faces = 0;
    for (int64_t f = 0; f < cage.faces; ++f) {
      near_faces += IsNear(cage, f, near);
    }
    if (near_faces > cage.faces / kMostlyNear) {
      double* exact = static_cast<double*>(scratch) + DoubleScratch(cage);
      InDouble(cage, points, scratch, exact);
      return RoundTile(exact, cage.vertices + cage.faces, points.count,
                       weights);
    }
    for (int64_t f = 0; f < cage.faces; ++f) {
      if (!IsNear(cage, f, near)) {
        AddFarFace(cage, f, seen, logs, at, weights);
        continue;
      }
      const int64_t end = HWY_MIN(at + kLanes, points.count);
      for (int64_t half = at; half < end; half += kHalf) {
        lost |= AddNearFace(cage, f, points, half, weights);
      }
    }
  }
  Close(d, cage.vertices, kMissingFloat, weights, points);
  points.solved &= ~lost;
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(InDouble);
HWY_EXPORT(InFloat);

int64_t Green3dLaneScratch(const GreenLaneCage& cage) {
  // What is seen of vertices and edges, and weights in double.
  return kTilePoints * (5 * cage.vertices + cage.edges + cage.faces) *
         int64_t{sizeof(double)};
}

void IntegrateGreen3d(const GreenLaneCage& cage, LanePoints& points,
                      void* scratch, double* weights) {
  HWY_DYNAMIC_DISPATCH(InDouble)(cage, points, scratch, weights);
}

void IntegrateGreen3d(const GreenLaneCage& cage, LanePoints& points,
                      void* scratch, float* weights) {
  HWY_DYNAMIC_DISPATCH(InFloat)(cage, points, scratch, weights);
}

}  // namespace deform
#endif  // HWY_ONCE
