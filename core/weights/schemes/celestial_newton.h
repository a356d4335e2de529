// Damped Newton on the potential of celestial coordinates: one point at a time,
// the plain judge of every faster way.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/types.h"
#include "core/weights/schemes/celestial_potential.h"

namespace deform {

// Unit directions q_i from a point to n handles and their distances. In 2D z is
// 0 throughout; a subspace without a component costs nothing but the zeros.
struct Directions {
  std::vector<double> x, y, z;
  std::vector<double> distance;  // > 0

  int64_t size() const { return static_cast<int64_t>(distance.size()); }
  Vec3 q(int64_t i) const { return {x[i], y[i], z[i]}; }
  void Resize(int64_t n);
  // Sets entry i to the direction and length of `offset`. Returns whether that
  // length is positive.
  bool Set(int64_t i, const Vec3& offset);
};

// Next to the hull y is so long that its rounding shows in the exponents.
using WideVec3 = Eigen::Matrix<long double, 3, 1>;

struct NewtonSolution {
  WideVec3 y = WideVec3::Zero();  // The best iterate.
  double residual = 0;            // |sum beta q| / sum beta at y.
  int iterations = 0;             // Newton steps.
  // If not 0: q_i . separator < 0 for all i. A plane separates the point from
  // all handles, and no solution exists. Rigorous.
  Vec3 separator = Vec3::Zero();

  bool separated() const { return !separator.isZero(0); }
};

// q_i . y
inline double Exponent(const Directions& q, int64_t i, const WideVec3& y) {
  return static_cast<double>(q.x[i] * y.x() + q.y[i] * y.y() + q.z[i] * y.z());
}

// Minimises the potential from `start`, or from 0 where that is the better
// start. Stops at a residual of 1e-15, or when it no longer falls; the best
// iterate is returned, whether good enough or not. O(n) a step.
//
// Works in double. Where y grows so long that rounding of the exponents shows in
// the residual, goes on with exponents from long double and the Hessian along
// its own axes.
NewtonSolution Minimize(const Directions& directions,
                        const ExponentialPotential& potential,
                        const WideVec3& start);
NewtonSolution Minimize(const Directions& directions,
                        const AsinhPotential& potential, const WideVec3& start);

}  // namespace deform
