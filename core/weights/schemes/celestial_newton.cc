#include "core/weights/schemes/celestial_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include <Eigen/Eigenvalues>

namespace deform {
namespace {

constexpr double kTargetResidual = 1e-15;
// What the rounding of exponents may add to a residual; beyond it the search
// goes on in long double, with the Hessian along its own axes.
constexpr double kMaxNoise = 1e-13;
// Below these residuals a search that has not halved its residual in so many
// steps has met the rounding floor.
constexpr double kDeepFloor = 1e-13;
constexpr int kDeepPatience = 1;
constexpr double kShallowFloor = 1e-4;
constexpr int kShallowPatience = 5;
constexpr int kMaxSteps = 120;
// In Newton steps; on the way to the hull these are too short by far.
constexpr double kLongestStep = 64;
// A fall of the potential by this part of its terms is no rounding.
constexpr double kFall = 1e-11;
// exp(600) can still be summed and cubed roots of it multiplied.
constexpr double kMaxExponent = 600;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class Real>
using Vector = Eigen::Matrix<Real, 3, 1>;

template <class Real>
double ExponentIn(const Directions& q, int64_t i, const Vector<Real>& y) {
  return static_cast<double>(q.x[i] * y.x() + q.y[i] * y.y() + q.z[i] * y.z());
}

// Phi and its derivatives at a point y, and what else one pass can tell.
struct Moments {
  double value = 0;
  double magnitude = 0;  // Of the terms of `value`, which may cancel.
  Vec3 gradient = Vec3::Zero();
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;  // Hessian.
  double beta_sum = 0;
  double largest_exponent = -kInfinity;

  double residual() const { return gradient.norm() / beta_sum; }
};

// The Hessian is that of the directions `h`.
template <class Potential, class Real>
Moments MomentsAt(const Directions& q, const Directions& h,
                  const Potential& potential, const Vector<Real>& y) {
  Moments m;
  for (int64_t i = 0; i < q.size(); ++i) {
    const double u = ExponentIn(q, i, y);
    const PotentialTerms terms = potential.At(i, u);
    m.value += terms.value;
    m.magnitude += std::abs(terms.value);
    m.beta_sum += terms.beta;
    m.gradient += terms.beta * q.q(i);
    const double cx = terms.curvature * h.x[i];
    const double cy = terms.curvature * h.y[i];
    m.xx += cx * h.x[i];
    m.xy += cx * h.y[i];
    m.xz += cx * h.z[i];
    m.yy += cy * h.y[i];
    m.yz += cy * h.z[i];
    m.zz += terms.curvature * h.z[i] * h.z[i];
    m.largest_exponent = std::max(m.largest_exponent, u);
  }
  return m;
}

// Solves A x = b for a symmetric positive semidefinite A by pivoted LDL^T after
// scaling the diagonal to 1: near the hull A has a condition of 1 / distance,
// nearly all of it in the scaling. Directions without curvature get 0.
Vec3 SolveSemidefinite(const Eigen::Matrix3d& matrix, const Vec3& b) {
  Vec3 scale;
  for (int k = 0; k < 3; ++k) {
    scale[k] = matrix(k, k) > 0 ? 1 / std::sqrt(matrix(k, k)) : 0;
  }
  Eigen::Matrix3d a = scale.asDiagonal() * matrix * scale.asDiagonal();
  Vec3 x = scale.cwiseProduct(b);
  int order[3] = {0, 1, 2};
  for (int k = 0; k < 3; ++k) {
    int best = k;
    for (int j = k + 1; j < 3; ++j) {
      if (a(order[j], order[j]) > a(order[best], order[best])) best = j;
    }
    std::swap(order[k], order[best]);
    const int p = order[k];
    if (!(a(p, p) > 0)) {
      for (int j = k; j < 3; ++j) x[order[j]] = 0, a(order[j], order[j]) = 0;
      break;
    }
    for (int j = k + 1; j < 3; ++j) {
      const int r = order[j];
      const double factor = a(r, p) / a(p, p);
      for (int l = k + 1; l < 3; ++l) a(r, order[l]) -= factor * a(p, order[l]);
      x[r] -= factor * x[p];
    }
  }
  for (int k = 2; k >= 0; --k) {
    const int p = order[k];
    if (!(a(p, p) > 0)) continue;
    for (int j = k + 1; j < 3; ++j) x[p] -= a(p, order[j]) * x[order[j]];
    x[p] /= a(p, p);
  }
  return scale.cwiseProduct(x);
}

Eigen::Matrix3d HessianOf(const Moments& m) {
  Eigen::Matrix3d hessian;
  hessian << m.xx, m.xy, m.xz, m.xy, m.yy, m.yz, m.xz, m.yz, m.zz;
  return hessian;
}

// How far one may go along `step`.
struct Reach {
  // The largest exponent stays below kMaxExponent.
  double length = kLongestStep;
  bool separates = true;  // q_i . step < 0 for all i.
};

template <class Real>
Reach ReachOf(const Directions& q, const Vector<Real>& y, const Vec3& step) {
  Reach reach;
  for (int64_t i = 0; i < q.size(); ++i) {
    const double du = ExponentIn(q, i, step);
    if (!(du < 0)) reach.separates = false;
    if (du > 0) {
      const double room = kMaxExponent - ExponentIn(q, i, y);
      reach.length = std::min(reach.length, room / du);
    }
  }
  return reach;
}

// The directions along other axes, in which the Hessian is written: next to a
// face or an edge of the hull, and among handles that are seen in nearly one
// direction, its condition is beyond all digits; along its own axes the thin
// ones keep theirs.
class Turned {
 public:
  explicit Turned(const Directions& q)
      : q_(q), along_(q), axes_(Eigen::Matrix3d::Identity()) {}

  const Directions& directions() const { return along_; }

  // -H^-1 g for the Hessian of `m`, which is along these axes.
  Vec3 NewtonStep(const Moments& m) const {
    const Vec3 along = SolveSemidefinite(HessianOf(m), axes_ * -m.gradient);
    return axes_.transpose() * along;
  }

  // Goes on to the axes of the Hessian of `m`, which is along these. A subspace
  // without a component keeps having none.
  void Turn(const Moments& m) {
    const Eigen::Matrix3d hessian = HessianOf(m) / (m.xx + m.yy + m.zz);
    if (!hessian.allFinite()) return;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    if (m.zz == 0) {
      const double angle = 0.5 * std::atan2(2 * m.xy, m.xx - m.yy);
      turn.topLeftCorner<2, 2>() << std::cos(angle), std::sin(angle),
          -std::sin(angle), std::cos(angle);
    } else {
      turn = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(hessian)
                 .eigenvectors()
                 .transpose();
    }
    axes_ = turn * axes_;
    for (int64_t i = 0; i < q_.size(); ++i) {
      const Vec3 along = axes_ * q_.q(i);
      along_.x[i] = along.x();
      along_.y[i] = along.y();
      along_.z[i] = along.z();
    }
  }

 private:
  const Directions& q_;
  Directions along_;
  Eigen::Matrix3d axes_;  // Rows.
};

template <class Potential, class Real>
class Descent {
  static constexpr bool kWide = !std::is_same_v<Real, double>;

 public:
  Descent(const Directions& q, const Potential& potential,
          const Vector<Real>& start)
      : q_(q), potential_(potential), y_(Vector<Real>::Zero()) {
    if constexpr (kWide) turned_.emplace(q);
    now_ = At(y_);
    if (start.isZero(0) || !start.allFinite()) return;
    const Moments other = At(start);
    if (!(other.value < now_.value)) return;
    y_ = start;
    now_ = other;
  }

  NewtonSolution Run() {
    NewtonSolution best{.residual = kInfinity};
    double milestone = kInfinity;  // Residual at the last halving.
    double fallen_to = kInfinity;  // Potential at the last true fall.
    int waited = 0;
    for (int steps = 0; steps <= kMaxSteps; ++steps) {
      const double residual = now_.residual();
      best.iterations = steps;
      if (residual < best.residual) {
        best.residual = residual;
        best.y = y_.template cast<long double>();
      }
      if (residual <= std::max(kTargetResidual, Noise())) break;
      if (now_.largest_exponent < 0) {
        return Separated(y_.template cast<double>(), best);
      }
      if (!kWide && Noise() > kMaxNoise) break;
      // Among directions of different scales the residual may rise for long
      // while the potential falls.
      const bool falls = now_.value < fallen_to - kFall * now_.magnitude;
      const bool halved = residual <= 0.5 * milestone;
      waited = halved || falls ? 0 : waited + 1;
      if (halved) milestone = residual;
      if (falls) fallen_to = now_.value;
      if (waited >= kDeepPatience && best.residual < kDeepFloor) break;
      if (waited >= kShallowPatience && best.residual < kShallowFloor) break;
      const Vec3 step = NewtonStep();
      if (!step.allFinite() || step.isZero(0)) break;
      const Reach reach = ReachOf(q_, y_, step);
      if (reach.separates) return Separated(step, best);
      if (!Advance(step, reach.length)) break;
    }
    return best;
  }

  // Where the search stands, which need not be the best place so far.
  const Vector<Real>& y() const { return y_; }

  // What the rounding of exponents adds to the residual.
  double Noise() const {
    return static_cast<double>(std::numeric_limits<Real>::epsilon() *
                               y_.norm());
  }

 private:
  Moments At(const Vector<Real>& y) const {
    return MomentsAt(q_, kWide ? turned_->directions() : q_, potential_, y);
  }

  Vec3 NewtonStep() {
    if constexpr (!kWide) {
      return SolveSemidefinite(HessianOf(now_), -now_.gradient);
    } else {
      const Vec3 step = turned_->NewtonStep(now_);
      turned_->Turn(now_);
      return step;
    }
  }

  static NewtonSolution Separated(const Vec3& by, NewtonSolution best) {
    best.separator = by;
    return best;
  }

  // Backtracks from the whole step until the potential falls enough. Where
  // rounding hides the fall of the potential, the slope decides, and where it
  // hides that, too, Newton's step is trusted. Where the whole step leaves much
  // of the slope, goes further, up to `longest`.
  bool Advance(const Vec3& step, double longest) {
    const double slope = now_.gradient.dot(step);
    double length = std::min(1.0, longest);
    if (!(length > 0)) return false;
    const bool hidden = -slope <= kFall * kFall * now_.magnitude;
    for (int halvings = 0; halvings < 60; ++halvings, length *= 0.5) {
      const Vector<Real> y = y_ + (length * step).template cast<Real>();
      const Moments next = At(y);
      const bool falls = next.value <= now_.value + 1e-4 * length * slope;
      const bool flattens = next.gradient.dot(step) <= 0.1 * std::abs(slope) &&
                            next.value <= now_.value + 1e-12 * now_.magnitude;
      if (falls || flattens || hidden) {
        const Vector<Real> from = std::exchange(y_, y);
        now_ = next;
        if (halvings > 0) {
          GoBetween(from, step, slope, length);
          went_further_ = false;
        } else {
          went_further_ = !hidden && !went_further_ &&
                          GoFurther(from, step, slope, length, longest);
        }
        return true;
      }
    }
    return false;
  }

  // The whole `length` is good and twice that is too far: perhaps half as much
  // again is better.
  void GoBetween(const Vector<Real>& from, const Vec3& step, double slope,
                 double length) {
    if (!(now_.gradient.dot(step) < 0.1 * slope)) return;
    const Vector<Real> y = from + (1.5 * length * step).template cast<Real>();
    const Moments next = At(y);
    if (!(next.value < now_.value)) return;
    y_ = y;
    now_ = next;
  }

  // Not twice in a row: directions in which the whole step was right are led
  // astray by it, and need one whole step to come back.
  bool GoFurther(const Vector<Real>& from, const Vec3& step, double slope,
                 double length, double longest) {
    bool went = false;
    while (now_.gradient.dot(step) < 0.1 * slope && 2 * length <= longest) {
      length *= 2;
      const Vector<Real> y = from + (length * step).template cast<Real>();
      const Moments next = At(y);
      if (!(next.value < now_.value && next.gradient.dot(step) <= 0)) break;
      y_ = y;
      now_ = next;
      went = true;
    }
    return went;
  }

  const Directions& q_;
  std::optional<Turned> turned_;  // If wide.
  const Potential& potential_;
  Vector<Real> y_;
  Moments now_;
  bool went_further_ = false;
};

template <class Potential>
NewtonSolution MinimizeIn(const Directions& q, const Potential& potential,
                          const WideVec3& start) {
  Descent<Potential, double> descent(q, potential, start.cast<double>());
  const NewtonSolution narrow = descent.Run();
  if (narrow.separated() ||
      narrow.residual + descent.Noise() <= 2 * kMaxNoise) {
    return narrow;
  }
  NewtonSolution wide =
      Descent<Potential, long double>(q, potential,
                                      descent.y().template cast<long double>())
          .Run();
  wide.iterations += narrow.iterations;
  return wide;
}

}  // namespace

void Directions::Resize(int64_t n) {
  for (auto* v : {&x, &y, &z, &distance}) v->resize(static_cast<size_t>(n));
}

bool Directions::Set(int64_t i, const Vec3& offset) {
  // Scaling by a power of two keeps squares in range and digits as they are.
  const double largest = offset.cwiseAbs().maxCoeff();
  const double scale = largest > 0 ? std::exp2(std::ilogb(largest)) : 1;
  const Vec3 scaled = offset / scale;
  const double length = scaled.norm();
  const Vec3 unit = scaled / length;
  x[i] = unit.x();
  y[i] = unit.y();
  z[i] = unit.z();
  distance[i] = length * scale;
  return distance[i] > 0;
}

NewtonSolution Minimize(const Directions& directions,
                        const ExponentialPotential& potential,
                        const WideVec3& start) {
  return MinimizeIn(directions, potential, start);
}

NewtonSolution Minimize(const Directions& directions,
                        const AsinhPotential& potential,
                        const WideVec3& start) {
  return MinimizeIn(directions, potential, start);
}

}  // namespace deform
