// Green coordinates of closed, oriented polygons: the integrals.
//
// Source: Lipman, Levin, Cohen-Or, "Green Coordinates", ACM TOG 27(3), 2008
//   [L08], Eq. 12 in the plane. eta is the point, phi the vertex weights and
//   psi the normal weights, as in the paper.
// Departs: Algorithm 1 negates phi and divides by zero on the line of an edge;
//   here angles come from atan2 and logarithms of ratios from log1p.
// Precision: 4e-16 at every distance. psi has the unit of length and, through a
//   logarithm of a length, depends on the unit, as in the paper.
// Cost: one atan2 and up to three logarithms per edge and point.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/weights/schemes/green.h"

namespace deform {
namespace {

using std::numbers::pi;

double Cross(const Vec3& a, const Vec3& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// x ln q, 0 at 0.
double TimesLog(double x, double q) { return x == 0 ? 0 : x * std::log(q); }

// An edge from i to j seen from eta, the domain to its left.
struct Integral {
  double phi_i, phi_j, psi;
};

Integral IntegrateEdge(const Vec3& b1, const Vec3& b2, const Vec3& a,
                       double l) {
  const double x1 = b1.dot(a) / l, x2 = b2.dot(a) / l, x = x1 + x2;
  const double q1 = b1.squaredNorm(), q2 = b2.squaredNorm();
  const double cr = Cross(q1 <= q2 ? b1 : b2, a);
  const double h = cr / l;
  if (q1 == 0 || q2 == 0) {  // At an end only psi is left: l (1 - ln l) / 2pi.
    return {0, 0, (l - TimesLog(l, l)) / (2 * pi)};
  }
  // ln(r2 / r1)
  const double lg = std::abs(x) * l < 0.5 * q1 ? 0.5 * std::log1p(l * x / q1)
                                               : 0.5 * std::log(q2 / q1);
  const double theta = h == 0 ? 0 : std::atan2(cr, b1.dot(b2));
  // Integral of ln r along the edge, but for - l + h theta.
  const double T = 0.5 * std::abs(x) > l
                       ? 0.25 * l * (std::log(q1) + std::log(q2)) + 0.5 * x * lg
                       : 0.5 * (TimesLog(x2, q2) - TimesLog(x1, q1));
  return {(x2 * theta - h * lg) / (2 * pi * l),
          (h * lg - x1 * theta) / (2 * pi * l),
          -(T - l + h * theta) / (2 * pi)};
}

class Green2d : public GreenIntegrals {
 public:
  explicit Green2d(const Cage& cage)
      : vertices_(cage.vertices()),
        edges_(cage.faces()),
        tolerance_(BoundaryTolerance(cage)) {}

  bool Integrate(const Vec3& eta, std::span<double> phi,
                 std::span<double> psi) const override;

 private:
  // Whether eta, with b1 and b2 relative to it, is about as close to an edge as
  // rounding can tell.
  bool Touches(const Vec3& b1, const Vec3& b2, const Vec3& a, double l) const {
    const Vec3& near = b1.squaredNorm() <= b2.squaredNorm() ? b1 : b2;
    return std::abs(Cross(near, a)) <= tolerance_ * l &&
           b1.dot(a) <= tolerance_ * l && b2.dot(a) >= -tolerance_ * l;
  }

  const Positions vertices_;
  const Faces edges_;
  const double tolerance_;
};

bool Green2d::Integrate(const Vec3& eta, std::span<double> phi,
                        std::span<double> psi) const {
  std::fill(phi.begin(), phi.end(), 0);
  bool touches = false;
  for (int64_t e = 0; e < edges_.rows(); ++e) {
    const int32_t i = edges_(e, 0), j = edges_(e, 1);
    const Vec3 b1 = vertices_.row(i).transpose() - eta;
    const Vec3 b2 = vertices_.row(j).transpose() - eta;
    const Vec3 a = vertices_.row(j) - vertices_.row(i);
    const double l = a.norm();
    const Integral integral = IntegrateEdge(b1, b2, a, l);
    phi[i] += integral.phi_i;
    phi[j] += integral.phi_j;
    psi[e] = integral.psi;
    touches |= Touches(b1, b2, a, l);
  }
  return touches;
}

}  // namespace

std::unique_ptr<const GreenIntegrals> MakeGreen2d(const Cage& cage) {
  return std::make_unique<Green2d>(cage);
}

}  // namespace deform
