// The gradients of Green coordinates, in closed form.
//
// Source: derivatives of the integrals in green_2d.cc and green_3d.cc, whose
//   symbols are used here: with r the distance from eta,
//
//     grad L     = integral of (x - eta) / r^3 along the edge
//                = t (1 / r_from - 1 / r_to) + kappa c x t,
//     c          = t x (v - eta), of either end v; |c| = delta
//     kappa      = (x2 / r_to - x1 / r_from) / delta^2
//     grad Omega = - sum over the edges of kappa c
//     grad psi   = (n Omega - sum m L) / 4 pi
//
//   The first by parts; the third since psi is a potential, its Hessian is
//   symmetric and without trace. Next to an edge grad Omega is as large as
//   1 / delta, and cancels between the faces that share it, with all its
//   errors, because they share c.
// Precision: 1e-13 over the distance from the nearest edge, where weights and
//   gradients have a singularity.
// Cost: as the weights, about.
#include "core/weights/schemes/green_gradient.h"

#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace deform {
namespace {

using std::numbers::pi;
using Face = CageFaces::Face;
using Gradients = Eigen::Ref<Positions>;

void AddEdge2d(const Face& edge, int64_t index, const Vec3& eta, Gradients& phi,
               Gradients& psi) {
  const Vec3 b1 = edge.position[0] - eta, b2 = edge.position[1] - eta;
  const Vec3& t = edge.m[0];
  const Vec3& n = edge.normal;
  const double l = edge.height[0];
  const double q1 = b1.squaredNorm(), q2 = b2.squaredNorm();
  const double h = (q1 < q2 ? b1 : b2).dot(n);
  const double x1 = b1.dot(t), x2 = b2.dot(t), x = x1 + x2;
  const double lg = std::abs(x) * l < 0.5 * q1 ? 0.5 * std::log1p(l * x / q1)
                                               : 0.5 * std::log(q2 / q1);
  const double theta = std::atan2(h * l, b1.dot(b2));
  const Vec3 turned = n * lg - t * theta;
  phi.row(edge.corner[0]) +=
      (turned + l / q1 * (h * t - x1 * n)).transpose() / (2 * pi * l);
  phi.row(edge.corner[1]) -=
      (turned + l / q2 * (h * t - x2 * n)).transpose() / (2 * pi * l);
  psi.row(index) = (t * lg + n * theta).transpose() / (2 * pi);
}

// An edge of a triangle, opposite corner q, seen from eta.
struct EdgeView {
  double d;  // Distance from eta's foot, > 0 on the inner side.
  double L;  // Integral of 1 / r.
  double x1, x2, r1, r2;
  Vec3 gradient;        // Of L.
  Vec3 omega_gradient;  // Its share.
};

EdgeView ViewOf(const Vec3& from, const Vec3& to, const Vec3& m) {
  EdgeView e;
  const double l = (to - from).norm();
  const Vec3 t = (to - from) / l;
  e.r1 = from.norm();
  e.r2 = to.norm();
  e.d = m.dot(e.r1 < e.r2 ? from : to);
  e.x1 = from.dot(t);
  e.x2 = to.dot(t);
  const Vec3 c = t.cross(e.r1 < e.r2 ? from : to);
  const double delta2 = c.squaredNorm();
  double kappa = 0;
  if (e.x1 < 0 && 0 < e.x2) {
    const double delta = std::sqrt(delta2);
    e.L = std::asinh(-e.x1 / delta) + std::asinh(e.x2 / delta);
    kappa = (e.x2 / e.r2 - e.x1 / e.r1) / delta2;
  } else {
    // Beside the edge the two parts would cancel.
    e.L = std::log1p(2 * l / (e.r1 + e.r2 - l));
    kappa = l * (e.x1 + e.x2) / (e.r1 * e.r2 * (e.x2 * e.r1 + e.x1 * e.r2));
  }
  e.gradient = t * (1 / e.r1 - 1 / e.r2) + kappa * c.cross(t);
  e.omega_gradient = -kappa * c;
  return e;
}

// The angle under which the face is seen: summed edge by edge, which keeps the
// digits close to an edge too.
double SolidAngle(const std::array<EdgeView, 3>& edges, double h) {
  if (h == 0) return 0;
  double sum = 0;
  for (const EdgeView& e : edges) {
    const double delta2 = e.d * e.d + h * h;
    sum += std::atan2(e.d * e.x2, delta2 + std::abs(h) * e.r2) -
           std::atan2(e.d * e.x1, delta2 + std::abs(h) * e.r1);
  }
  return std::copysign(std::abs(sum), h);
}

void AddTriangle(const Face& face, int64_t index, const Vec3& eta,
                 Gradients& phi, Gradients& psi) {
  std::array<Vec3, 3> a;
  int nearest = 0;
  for (int k = 0; k < 3; ++k) {
    a[k] = face.position[k] - eta;
    if (a[k].squaredNorm() < a[nearest].squaredNorm()) nearest = k;
  }
  const Vec3& n = face.normal;
  const double h = n.dot(a[nearest]);
  std::array<EdgeView, 3> edges;
  Vec3 omega_gradient = Vec3::Zero(), across = Vec3::Zero();
  for (int q = 0; q < 3; ++q) {
    edges[q] = ViewOf(a[(q + 1) % 3], a[(q + 2) % 3], face.m[q]);
    omega_gradient += edges[q].omega_gradient;
    across += edges[q].L * face.m[q];
  }
  const double omega = SolidAngle(edges, h);
  for (int q = 0; q < 3; ++q) {
    Vec3 logs_gradient = Vec3::Zero();
    for (int p = 0; p < 3; ++p) {
      logs_gradient += face.m[q].dot(face.m[p]) * edges[p].gradient;
    }
    // phi_q = (d Omega + h m_q . across) / (4 pi height)
    phi.row(face.corner[q]) +=
        (edges[q].d * omega_gradient - omega * face.m[q] + h * logs_gradient -
         face.m[q].dot(across) * n)
            .transpose() /
        (4 * pi * face.height[q]);
  }
  psi.row(index) = (omega * n - across).transpose() / (4 * pi);
}

}  // namespace

void GreenGradients(const CageFaces& faces, const Vec3& eta,
                    Eigen::Ref<Positions> phi, Eigen::Ref<Positions> psi) {
  phi.setZero();
  for (int64_t f = 0; f < faces.size(); ++f) {
    if (faces.corners() == 2) {
      AddEdge2d(faces[f], f, eta, phi, psi);
    } else {
      AddTriangle(faces[f], f, eta, phi, psi);
    }
  }
}

}  // namespace deform
