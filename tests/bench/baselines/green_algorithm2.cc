#include "tests/bench/baselines/green_algorithm2.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace deform::bench {
namespace {

using std::numbers::pi;

double Sign(double x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }

double Angle(const Vec3& a, const Vec3& b) {
  return std::acos(std::clamp(a.dot(b) / (a.norm() * b.norm()), -1.0, 1.0));
}

// The triangle (p, v1, v2) seen from eta, which is the origin.
double GcTriInt(const Vec3& p, const Vec3& v1, const Vec3& v2) {
  const double alpha = Angle(v2 - v1, p - v1);
  const double beta = Angle(v1 - p, v2 - p);
  const double sine = std::sin(alpha);
  const double lambda = (p - v1).squaredNorm() * sine * sine;
  const double c = p.squaredNorm();
  const auto integral = [&](double theta) {
    const double S = std::sin(theta), C = std::cos(theta), S2 = S * S;
    const double turn =
        2 * std::sqrt(c) *
        std::atan(std::sqrt(c) * C / std::sqrt(lambda + S2 * c));
    const double logarithm =
        std::log(2 * std::sqrt(lambda) * S2 / ((1 - C) * (1 - C)) *
                 (1 - 2 * c * C /
                          (c * (1 + C) + lambda +
                           std::sqrt(lambda * lambda + lambda * c * S2))));
    return -Sign(S) / 2 * (turn + std::sqrt(lambda) * logarithm);
  };
  return -std::abs(integral(pi - alpha) - integral(pi - alpha - beta) -
                   std::sqrt(c) * beta) /
         (4 * pi);
}

}  // namespace

void GreenAlgorithm2(const Cage& cage, const Vec3& eta, std::span<double> phi,
                     std::span<double> psi) {
  constexpr double kEpsilon = 1e-12;
  std::fill(phi.begin(), phi.end(), 0);
  for (int64_t j = 0; j < cage.face_count(); ++j) {
    Vec3 v[3];
    for (int l = 0; l < 3; ++l) {
      v[l] = cage.vertices().row(cage.faces()(j, l)).transpose() - eta;
    }
    const Vec3 n = (v[1] - v[0]).cross(v[2] - v[0]).normalized();
    const Vec3 p = v[0].dot(n) * n;
    double I = 0;
    Vec3 N[3];
    Vec3 w = Vec3::Zero();
    for (int l = 0; l < 3; ++l) {
      const Vec3& next = v[(l + 1) % 3];
      const double s = Sign((v[l] - p).cross(next - p).dot(n));
      I += s * GcTriInt(p, v[l], next);
      N[l] = next.cross(v[l]).normalized();
      w += GcTriInt(Vec3::Zero(), next, v[l]) * N[l];
    }
    I = -std::abs(I);
    psi[j] = -I;
    w += n * I;
    if (w.norm() <= kEpsilon) continue;
    for (int l = 0; l < 3; ++l) {
      const Vec3& across = N[(l + 1) % 3];
      phi[cage.faces()(j, l)] += across.dot(w) / across.dot(v[l]);
    }
  }
}

}  // namespace deform::bench
