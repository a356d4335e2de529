// Logarithms and angles of vectors, with one division each and no case left to
// a branch. Included by the lane kernels, once for each instruction set.
//
// The polynomials are minimax in relative error (Remez exchange in 60 digits):
// below a unit in the last place.

#if defined(DEFORM_CORE_WEIGHTS_SCHEMES_LANE_MATH_INL_H_) == \
    defined(HWY_TARGET_TOGGLE)
#ifdef DEFORM_CORE_WEIGHTS_SCHEMES_LANE_MATH_INL_H_
#undef DEFORM_CORE_WEIGHTS_SCHEMES_LANE_MATH_INL_H_
#else
#define DEFORM_CORE_WEIGHTS_SCHEMES_LANE_MATH_INL_H_
#endif

#include "core/weights/schemes/lane_points.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace deform {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <typename T>
struct LaneConstants;

template <>
struct LaneConstants<float> {
  static constexpr int kMantissaBits = 23;
  static constexpr int32_t kBias = 128;
  static constexpr float kMagic = 0x1p23f;
  // 2 atanh(z) / z in z^2, |z| <= 0.201, to 3e-9.
  static constexpr float kLog[] = {1.9999999950044049f, 0.66667060230665921f,
                                   0.39951691063536632f, 0.30454463680776207f};
  // atan(z) / z in z^2, |z| <= tan(pi / 8), to 6e-10.
  static constexpr float kAngle[] = {
      0.99999999939666863f,  -0.33333307625742470f, 0.19998216941979557f,
      -0.14240082902447400f, 0.10573479009721551f,  -0.06034788285367676f};
};

template <>
struct LaneConstants<double> {
  static constexpr int kMantissaBits = 52;
  static constexpr int64_t kBias = 1024;
  static constexpr double kMagic = 0x1p52;
  // To 2e-17 and 2e-18.
  static constexpr double kLog[] = {
      1.9999999999999999701,  0.66666666666676096469, 0.39999999995115716427,
      0.28571429534280204555, 0.22222129159564086809, 0.18186688848505765675,
      0.15244200023207710901, 0.15411018366712596181};
  static constexpr double kAngle[] = {
      0.99999999999999999879,  -0.33333333333333129098,
      0.19999999999942732295,  -0.14285714279416941938,
      0.1111111075266539847,   -0.09090897019112125152,
      0.076920488830436371311, -0.066629904012159643491,
      0.058471476314841095895, -0.050362699705096608609,
      0.037993862054469566763, -0.01783566489081482954};
};

// sum of c[k] x^k.
template <class D, int kCount>
HWY_INLINE hn::Vec<D> Polynomial(D d, hn::Vec<D> x,
                                 const hn::TFromD<D> (&c)[kCount]) {
  hn::Vec<D> sum = hn::Set(d, c[kCount - 1]);
  for (int k = kCount - 2; k >= 0; --k) {
    sum = hn::MulAdd(sum, x, hn::Set(d, c[k]));
  }
  return sum;
}

// ln(a / b) of positive numbers, with `difference` = a - b, which the caller
// knows to more digits than the subtraction would leave.
//
// b is brought within a factor of 1.5 of a by a power of two, found from the
// difference of their bits; then 2 atanh((a - b) / (a + b)).
template <class D>
HWY_INLINE hn::Vec<D> LogOfRatio(D d, hn::Vec<D> a, hn::Vec<D> b,
                                 hn::Vec<D> difference) {
  using T = hn::TFromD<D>;
  using C = LaneConstants<T>;
  const hn::RebindToUnsigned<D> bits;
  using Bits = hn::TFromD<decltype(bits)>;
  constexpr Bits kOne = Bits{1} << C::kMantissaBits;
  constexpr Bits kBias = static_cast<Bits>(C::kBias) << C::kMantissaBits;
  const auto exponent = hn::BitCast(bits, a) - hn::BitCast(bits, b) +
                        hn::Set(bits, kBias + kOne / 2);
  const auto power =
      hn::AndNot(hn::Set(bits, kOne - 1), exponent) - hn::Set(bits, kBias);
  const auto k =
      hn::BitCast(d, hn::Or(hn::ShiftRight<C::kMantissaBits>(exponent),
                            hn::BitCast(bits, hn::Set(d, C::kMagic)))) -
      hn::Set(d, C::kMagic + C::kBias);
  const auto near = hn::BitCast(d, hn::BitCast(bits, b) + power);
  const auto z =
      hn::IfThenElse(k == hn::Zero(d), difference, a - near) / (a + near);
  const auto log = z * Polynomial(d, z * z, C::kLog);
  return hn::MulAdd(k, hn::Set(d, static_cast<T>(0.693147180559945309417)),
                    log);
}

// The angle of (x, y) for y >= 0: atan2(y, x), from 0 to pi. Not a number at
// the origin.
template <class D>
HWY_INLINE hn::Vec<D> AngleOf(D d, hn::Vec<D> y, hn::Vec<D> x) {
  using T = hn::TFromD<D>;
  constexpr auto kPi = static_cast<T>(3.14159265358979323846);
  const auto ax = hn::Abs(x);
  const auto low = hn::Min(ax, y);
  const auto high = hn::Max(ax, y);
  // Beyond pi / 8 from pi / 4 on.
  const auto turned =
      low > high * hn::Set(d, static_cast<T>(0.41421356237309504880));
  const auto t = hn::IfThenElse(turned, low - high, low) /
                 (high + hn::IfThenElseZero(turned, low));
  auto angle = hn::MulAdd(t, Polynomial(d, t * t, LaneConstants<T>::kAngle),
                          hn::IfThenElseZero(turned, hn::Set(d, kPi / 4)));
  angle = hn::IfThenElse(y > ax, hn::Set(d, kPi / 2) - angle, angle);
  return hn::IfThenElse(x < hn::Zero(d), hn::Set(d, kPi) - angle, angle);
}

// A vector in space for each lane. Made with its content: constructors that GCC
// makes by itself are for no instruction set, which Arm's lanes refuse. So no
// type with lanes in it may need them.
template <class D>
struct Space {
  hn::Vec<D> x, y, z;

  HWY_INLINE hn::Vec<D> Dot(const Space& other) const {
    return hn::MulAdd(x, other.x, hn::MulAdd(y, other.y, z * other.z));
  }
  // With the same for all lanes.
  HWY_INLINE hn::Vec<D> Dot(D d, const hn::TFromD<D>* other) const {
    return hn::MulAdd(
        x, hn::Set(d, other[0]),
        hn::MulAdd(y, hn::Set(d, other[1]), z * hn::Set(d, other[2])));
  }
};

template <class D>
HWY_INLINE void AddTo(D d, hn::Vec<D> term, hn::TFromD<D>* HWY_RESTRICT to) {
  hn::Store(hn::Load(d, to) + term, d, to);
}

// Rounds the first `count` points of a tile to float: infinity where it cannot.
HWY_INLINE void RoundTile(const double* HWY_RESTRICT from, int64_t columns,
                          int64_t count, float* HWY_RESTRICT to) {
  const hn::CappedTag<double, kTilePoints> d;
  const hn::Rebind<float, decltype(d)> half;
  for (int64_t c = 0; c < columns; ++c) {
    for (int64_t at = c * kTilePoints; at < c * kTilePoints + count;
         at += static_cast<int64_t>(hn::MaxLanes(d))) {
      hn::Store(hn::DemoteTo(half, hn::Load(d, from + at)), half, to + at);
    }
  }
}

template <class D>
HWY_INLINE hn::Mask<D> NoLane(D d) {
  return hn::Zero(d) != hn::Zero(d);
}

// A bit for each lane of the mask.
template <class D>
HWY_INLINE uint32_t BitsOf(D d, hn::Mask<D> mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0] | uint32_t{bytes[1]} << 8;
}

}  // namespace HWY_NAMESPACE
}  // namespace deform
HWY_AFTER_NAMESPACE();

#endif  // DEFORM_CORE_WEIGHTS_SCHEMES_LANE_MATH_INL_H_
