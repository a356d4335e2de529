// Undamped Newton on the potentials of celestial_potential.h: for easy points
// that is all that is needed, and where it does not converge the lane is given
// up. One pass over the handles a step, the first ones in float: a square root
// and a division per handle are most of the cost.
//
// One source, compiled by Highway for each instruction set.
#include "core/weights/schemes/celestial_lanes.h"

// Vectors of unknown size (SVE, RVV) cannot lie in arrays; Arm runs NEON.
#define HWY_DISABLED_TARGETS \
  (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/weights/schemes/celestial_lanes.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
// After foreach_target.h, which reads it once per target.
#include "hwy/contrib/math/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, kMaxCelestialLanes>;
using Floats = hn::Rebind<float, Doubles>;
constexpr Doubles kDoubles;
constexpr Floats kFloats;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kDoubles));

// Once a step is this short, the betas may be carried along it by their
// derivatives: what is left out is its square.
constexpr double kShortStep = 1e-8;
// From here one more step is as far as float gets.
constexpr float kShortFloatStep = 3e-3f;
constexpr int kMaxFloatSteps = 8;
constexpr int kMaxSteps = 12;
// The rounding of a thousand handles; what is above goes the plain way.
constexpr double kSolvedResidual = 1e-14;
// Largest over smallest weight of what surely is not on the hull.
constexpr double kHullContrast = 1e13;
// Squares of distances beyond which digits are lost.
constexpr double kLeastSquare = 1e-280;
constexpr double kLargestSquare = 1e280;

// The direction to a handle, or a place or step in the space of y.
template <class D>
struct Triple {
  hn::Vec<D> x, y, z;

  HWY_INLINE hn::Vec<D> Dot(const Triple& other) const {
    return hn::MulAdd(x, other.x, hn::MulAdd(y, other.y, z * other.z));
  }
  HWY_INLINE void Add(const Triple& other) {
    x = x + other.x;
    y = y + other.y;
    z = z + other.z;
  }
  HWY_INLINE void AddScaled(const hn::Vec<D>& factor, const Triple& other) {
    x = hn::MulAdd(factor, other.x, x);
    y = hn::MulAdd(factor, other.y, y);
    z = hn::MulAdd(factor, other.z, z);
  }
};

template <class D, class T>
HWY_INLINE Triple<D> LoadTriple(D d, const T* HWY_RESTRICT from) {
  return {hn::Load(d, from), hn::Load(d, from + kLanes),
          hn::Load(d, from + 2 * kLanes)};
}

template <class D, class T>
HWY_INLINE void StoreTriple(const Triple<D>& triple, D d, T* HWY_RESTRICT to) {
  hn::Store(triple.x, d, to);
  hn::Store(triple.y, d, to + kLanes);
  hn::Store(triple.z, d, to + 2 * kLanes);
}

template <class D>
struct Terms {
  hn::Vec<D> beta, curvature;
};

// T-CC: beta = exp(u) + s.
struct Translation {
  const double* s;

  template <class D>
  HWY_INLINE Terms<D> At(D d, int64_t i, hn::Vec<D> u) const {
    using T = hn::TFromD<D>;
    // A search that meets larger exponents is lost. To bound them instead would
    // make a solution of any place where all that is large is bounded.
    const auto e =
        hn::IfThenElse(u > hn::Set(d, T{80}), hn::NaN(d), hn::Exp(d, u));
    return {e + hn::Set(d, static_cast<T>(s[i])), e};
  }
};

// S-CC: beta = exp(asinh u)^2.
struct Scaling {
  template <class D>
  HWY_INLINE Terms<D> At(D d, int64_t /*i*/, hn::Vec<D> u) const {
    using T = hn::TFromD<D>;
    const auto one = hn::Set(d, T{1});
    const auto root = hn::Sqrt(hn::MulAdd(u, u, one));
    const auto sum = root + hn::Abs(u);
    // 1 / sum and 1 / root with one division.
    const auto inverse = one / (sum * root);
    const auto e = hn::IfThenElse(u < hn::Zero(d), inverse * root, sum);
    const auto beta = e * e;
    return {beta, hn::Set(d, T{2}) * beta * (inverse * sum)};
  }
};

// What the passes over the handles read and write.
struct Arrays {
  double* q;      // n x 4 x L: unit direction, inverse distance.
  double* terms;  // n x 2 x L: beta and curvature of the last pass in double.
  float* half;    // n x 3 x L: the direction in float.
};

using Lane = hn::Vec<Doubles>;
using LaneMask = hn::Mask<Doubles>;
using LaneTriple = Triple<Doubles>;

// Returns the lanes that keep their digits.
HWY_INLINE LaneMask LookAtHandles(const CelestialLaneJob& job,
                                  const Arrays& arrays) {
  constexpr Doubles d;
  const LaneTriple point = LoadTriple(d, job.points);
  Lane least = hn::Set(d, kLargestSquare);
  Lane largest = hn::Zero(d);
  for (int64_t i = 0; i < job.handles; ++i) {
    LaneTriple q = {hn::Set(d, job.x[i]) - point.x,
                    hn::Set(d, job.y[i]) - point.y,
                    hn::Set(d, job.z[i]) - point.z};
    const Lane square = q.Dot(q);
    least = hn::Min(least, square);
    largest = hn::Max(largest, square);
    const Lane inverse = hn::Set(d, 1) / hn::Sqrt(square);
    q = {q.x * inverse, q.y * inverse, q.z * inverse};
    double* to = arrays.q + i * 4 * kLanes;
    StoreTriple(q, d, to);
    hn::Store(inverse, d, to + 3 * kLanes);
    StoreTriple<Floats>({hn::DemoteTo(kFloats, q.x), hn::DemoteTo(kFloats, q.y),
                         hn::DemoteTo(kFloats, q.z)},
                        kFloats, arrays.half + i * 3 * kLanes);
  }
  return hn::And(least > hn::Set(d, kLeastSquare),
                 largest < hn::Set(d, kLargestSquare));
}

// Gradient and Hessian.
template <class D>
struct Moments {
  Triple<D> gradient;
  hn::Vec<D> xx, xy, xz, yy, yz, zz;

  HWY_INLINE explicit Moments(D d)
      : gradient{hn::Zero(d), hn::Zero(d), hn::Zero(d)},
        xx(hn::Zero(d)),
        xy(xx),
        xz(xx),
        yy(xx),
        yz(xx),
        zz(xx) {}

  HWY_INLINE void Add(const Terms<D>& terms, const Triple<D>& q) {
    gradient.AddScaled(terms.beta, q);
    const auto cx = terms.curvature * q.x;
    const auto cy = terms.curvature * q.y;
    xx = hn::MulAdd(cx, q.x, xx);
    xy = hn::MulAdd(cx, q.y, xy);
    xz = hn::MulAdd(cx, q.z, xz);
    yy = hn::MulAdd(cy, q.y, yy);
    yz = hn::MulAdd(cy, q.z, yz);
    zz = hn::MulAdd(terms.curvature * q.z, q.z, zz);
  }

  // The Newton step. A direction without curvature (z in 2D) is left alone.
  HWY_INLINE Triple<D> Step(D d) const {
    const auto one = hn::Set(d, hn::TFromD<D>{1});
    const auto ixx = one / xx;
    const auto lxy = xy * ixx;
    const auto lxz = xz * ixx;
    const auto idy = one / (yy - lxy * xy);
    const auto c = yz - lxz * xy;
    const auto lyz = c * idy;
    const auto dz = zz - lxz * xz - lyz * c;
    const auto by = gradient.y - lxy * gradient.x;
    const auto bz = gradient.z - lxz * gradient.x - lyz * by;
    const auto z = hn::IfThenElseZero(zz > hn::Zero(d), hn::Neg(bz) / dz);
    const auto y = hn::Neg(by) * idy - lyz * z;
    const auto x = hn::Neg(gradient.x) * ixx - lxy * y - lxz * z;
    return {x, y, z};
  }
};

// Steps in float until all lanes are as near as float gets.
template <class Potential>
HWY_INLINE void Approach(const Potential& potential, const Arrays& arrays,
                         CelestialLaneJob& job) {
  constexpr Floats d;
  const LaneTriple start = LoadTriple(kDoubles, job.solution);
  Triple<Floats> y = {hn::DemoteTo(d, start.x), hn::DemoteTo(d, start.y),
                      hn::DemoteTo(d, start.z)};
  const auto enough = hn::Set(d, kShortFloatStep * kShortFloatStep);
  while (job.steps < kMaxFloatSteps) {
    Moments moments(d);
    for (int64_t i = 0; i < job.handles; ++i) {
      const auto q = LoadTriple(d, arrays.half + i * 3 * kLanes);
      moments.Add(potential.At(d, i, q.Dot(y)), q);
    }
    const auto step = moments.Step(d);
    y.Add(step);
    ++job.steps;
    // A lane that lost its numbers is not waited for.
    if (hn::AllFalse(d, step.Dot(step) > enough)) break;
  }
  StoreTriple<Doubles>(
      {hn::PromoteTo(kDoubles, y.x), hn::PromoteTo(kDoubles, y.y),
       hn::PromoteTo(kDoubles, y.z)},
      kDoubles, job.solution);
}

// Steps in double until all lanes are so near that the betas can be carried
// along the last step, which `step` returns together with the lanes that are.
template <class Potential>
HWY_INLINE LaneMask Arrive(const Potential& potential, const Arrays& arrays,
                           CelestialLaneJob& job, LaneTriple& step) {
  constexpr Doubles d;
  LaneTriple y = LoadTriple(d, job.solution);
  const Lane enough = hn::Set(d, kShortStep * kShortStep);
  for (;;) {
    Moments moments(d);
    for (int64_t i = 0; i < job.handles; ++i) {
      const LaneTriple q = LoadTriple(d, arrays.q + i * 4 * kLanes);
      const auto terms = potential.At(d, i, q.Dot(y));
      moments.Add(terms, q);
      hn::Store(terms.beta, d, arrays.terms + 2 * i * kLanes);
      hn::Store(terms.curvature, d, arrays.terms + (2 * i + 1) * kLanes);
    }
    step = moments.Step(d);
    y.Add(step);
    ++job.steps;
    const Lane length = step.Dot(step);
    if (job.steps >= kMaxSteps || hn::AllFalse(d, length > enough)) {
      StoreTriple(y, d, job.solution);
      return length <= enough;
    }
  }
}

// Writes the weights and their residuals, and returns the lanes solved.
HWY_INLINE LaneMask Spread(const Arrays& arrays, const LaneTriple& step,
                           int64_t n, double* HWY_RESTRICT weights,
                           double* HWY_RESTRICT residual) {
  constexpr Doubles d;
  Lane sum = hn::Zero(d);
  Lane total = sum;
  LaneTriple gradient = {sum, sum, sum};
  Lane least = hn::Set(d, 1e300);
  Lane most = sum;
  for (int64_t i = 0; i < n; ++i) {
    const double* from = arrays.q + i * 4 * kLanes;
    const LaneTriple q = LoadTriple(d, from);
    const Lane curvature = hn::Load(d, arrays.terms + (2 * i + 1) * kLanes);
    const Lane beta = hn::MulAdd(curvature, q.Dot(step),
                                 hn::Load(d, arrays.terms + 2 * i * kLanes));
    const Lane weight = beta * hn::Load(d, from + 3 * kLanes);
    sum = sum + beta;
    total = total + weight;
    gradient.AddScaled(beta, q);
    least = hn::Min(least, weight);
    most = hn::Max(most, weight);
    hn::Store(weight, d, weights + i * kLanes);
  }
  const Lane scale = hn::Set(d, 1) / total;
  for (int64_t i = 0; i < n; ++i) {
    double* weight = weights + i * kLanes;
    hn::Store(hn::Load(d, weight) * scale, d, weight);
  }
  const Lane distance = hn::Sqrt(gradient.Dot(gradient)) / sum;
  hn::Store(distance, d, residual);
  return hn::And(distance <= hn::Set(d, kSolvedResidual),
                 most < hn::Set(d, kHullContrast) * least);
}

template <class Potential>
HWY_INLINE void SolveIn(const Potential& potential, CelestialLaneJob& job) {
  const int64_t n = job.handles;
  double* terms = job.scratch + 4 * n * kLanes;
  const Arrays arrays = {job.scratch, terms,
                         reinterpret_cast<float*>(terms + 2 * n * kLanes)};
  job.steps = 0;
  const LaneMask clear = LookAtHandles(job, arrays);
  Approach(potential, arrays, job);
  const auto zero = hn::Zero(kDoubles);
  LaneTriple step = {zero, zero, zero};
  const LaneMask near = Arrive(potential, arrays, job, step);
  const LaneMask exact = Spread(arrays, step, n, job.weights, job.residual);
  uint8_t bits[8] = {};
  hn::StoreMaskBits(kDoubles, hn::And(clear, hn::And(near, exact)), bits);
  job.solved = bits[0];
}

void Solve(CelestialLaneJob& job) {
  if (job.s == nullptr) {
    SolveIn(Scaling(), job);
  } else {
    SolveIn(Translation{job.s}, job);
  }
}

int Lanes() { return kLanes; }

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace deform {

HWY_EXPORT(Solve);
HWY_EXPORT(Lanes);

int CelestialLanes() { return HWY_DYNAMIC_DISPATCH(Lanes)(); }

void SolveCelestialLanes(CelestialLaneJob& job) {
  HWY_DYNAMIC_DISPATCH(Solve)(job);
}

}  // namespace deform
#endif  // HWY_ONCE
