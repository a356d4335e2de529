// Green coordinates of a closed triangle cage: the integrals.
//
// Source: Lipman, Levin, Cohen-Or, "Green Coordinates", ACM TOG 27(3), 2008
//   [L08], Eq. 12, in the closed form of Urago (2000). eta is the point, phi
//   the vertex weights and psi the normal weights, as in the paper.
// Departs: edge logarithms and solid angles by atan2 instead of Algorithm 2,
//   whose printed form is wrong and whose acos loses half the digits. Close to
//   an edge the solid angle is summed edge by edge after Wilton et al. (1984).
// Precision: phi to 1e-15 and psi to 1e-16 D, after the closure; thin faces
// lose
//   a factor of their aspect ratio in phi.
// Cost: one logarithm per edge and one atan2 per face and point.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "core/weights/cage_edges.h"
#include "core/weights/cage_faces.h"
#include "core/weights/schemes/green.h"

namespace deform {
namespace {

using std::numbers::pi;

// An edge, once for the two faces that share it.
struct Edge {
  int32_t from, to;
  Vec3 t;  // Unit direction.
  double length;
};

// Corner q lies opposite edge q, which runs from corner q + 1 to q + 2.
struct Face {
  int32_t corner[3];
  int32_t edge[3];
  Vec3 n;     // Unit, outward.
  Vec3 t[3];  // Unit direction of edge q.
  Vec3 m[3];  // t x n: unit outward normal of edge q within the plane.
  double length[3];
  double cosine[3];  // m_{q+1} . m_{q+2}
  double area2;      // Twice the area.
};

// One point seen from all vertices and edges.
struct Sight {
  std::vector<Vec3> a;    // vertex - eta
  std::vector<double> r;  // |a|
  std::vector<double> L;  // Integral of 1 / distance along the edge.
};

// L of the segment between two points a and b, relative to eta.
double EdgeLogarithm(const Vec3& a, const Vec3& b, double ra, double rb,
                     const Edge& edge) {
  const double excess = ra + rb - edge.length;
  if (excess < 0.1 * edge.length) {
    const double x1 = a.dot(edge.t), x2 = b.dot(edge.t);
    if (x1 < 0 && 0 < x2) {
      // Close to the edge, where the excess has lost its digits.
      const double delta = (ra < rb ? a : b).cross(edge.t).norm();
      if (delta == 0) return 0;  // Every factor of L is 0 there.
      return std::asinh(-x1 / delta) + std::asinh(x2 / delta);
    }
    if (!(excess > 0)) return 0;
  }
  return std::log1p(2 * edge.length / excess);
}

// The part of a face that eta sees: signed height and distances, computed from
// the closest corners, which keep the digits.
struct View {
  double h;     // a . n: positive inside.
  double d[3];  // m_q . a
};

View ViewOf(const Face& face, const Vec3* const (&a)[3], const double (&r)[3]) {
  View view;
  const int near =
      r[0] <= r[1] ? (r[0] <= r[2] ? 0 : 2) : (r[1] <= r[2] ? 1 : 2);
  view.h = face.n.dot(*a[near]);
  for (int q = 0; q < 3; ++q) {
    const int from = (q + 1) % 3, to = (q + 2) % 3;
    view.d[q] = face.m[q].dot(*a[r[from] <= r[to] ? from : to]);
  }
  return view;
}

// Close to an edge det and den of the usual form both vanish; the sum over the
// edges does not.
double SolidAngleByEdges(const Face& face, const View& view,
                         const Vec3* const (&a)[3], const double (&r)[3]) {
  const double h = std::abs(view.h);
  double sum = 0;
  for (int q = 0; q < 3; ++q) {
    const int from = (q + 1) % 3, to = (q + 2) % 3;
    const double d = view.d[q], delta2 = d * d + h * h;
    sum += std::atan2(d * face.t[q].dot(*a[to]), delta2 + h * r[to]) -
           std::atan2(d * face.t[q].dot(*a[from]), delta2 + h * r[from]);
  }
  return std::copysign(std::abs(sum), view.h);
}

double SolidAngle(const Face& face, const View& view, const Vec3* const (&a)[3],
                  const double (&r)[3]) {
  if (view.h == 0) return 0;
  const double rrr = r[0] * r[1] * r[2];
  const double det = face.area2 * view.h;
  const double den = rrr + a[0]->dot(*a[1]) * r[2] + a[1]->dot(*a[2]) * r[0] +
                     a[2]->dot(*a[0]) * r[1];
  if (std::abs(det) + std::abs(den) >= 1e-3 * rrr) {
    return 2 * std::atan2(det, den);
  }
  return SolidAngleByEdges(face, view, a, r);
}

class Green3d : public GreenIntegrals {
 public:
  explicit Green3d(const Cage& cage);

  bool Integrate(const Vec3& eta, std::span<double> phi,
                 std::span<double> psi) const override;

 private:
  void Look(const Vec3& eta, Sight& sight) const;
  // Adds the face's share to phi and returns psi.
  double IntegrateFace(const Face& face, const Sight& sight, double* phi,
                       bool& touches) const;

  const Positions vertices_;
  const double tolerance_;
  std::vector<Edge> edges_;
  std::vector<Face> faces_;
};

Green3d::Green3d(const Cage& cage)
    : vertices_(cage.vertices()), tolerance_(BoundaryTolerance(cage)) {
  const CageEdges edges(cage);
  for (const auto& [from, to] : edges.edges) {
    const Vec3 edge = vertices_.row(to) - vertices_.row(from);
    edges_.push_back({from, to, edge.normalized(), edge.norm()});
  }
  const CageFaces geometry(cage);
  faces_.resize(geometry.size());
  for (int64_t f = 0; f < geometry.size(); ++f) {
    Face& face = faces_[f];
    face.n = geometry[f].normal;
    for (int q = 0; q < 3; ++q) {
      const int32_t from = geometry[f].corner[(q + 1) % 3];
      const int32_t to = geometry[f].corner[(q + 2) % 3];
      const Vec3 edge = vertices_.row(to) - vertices_.row(from);
      face.corner[q] = geometry[f].corner[q];
      face.length[q] = edge.norm();
      face.t[q] = edge / face.length[q];
      face.m[q] = geometry[f].m[q];
      face.cosine[q] =
          geometry[f].m[(q + 1) % 3].dot(geometry[f].m[(q + 2) % 3]);
      face.area2 = geometry[f].height[q] * face.length[q];
      face.edge[q] = edges.of_face[f][q];
    }
  }
}

void Green3d::Look(const Vec3& eta, Sight& sight) const {
  for (int64_t v = 0; v < vertices_.rows(); ++v) {
    sight.a[v] = vertices_.row(v).transpose() - eta;
    sight.r[v] = sight.a[v].norm();
  }
  for (size_t e = 0; e < edges_.size(); ++e) {
    const Edge& edge = edges_[e];
    sight.L[e] = EdgeLogarithm(sight.a[edge.from], sight.a[edge.to],
                               sight.r[edge.from], sight.r[edge.to], edge);
  }
}

double Green3d::IntegrateFace(const Face& face, const Sight& sight, double* phi,
                              bool& touches) const {
  const Vec3* a[3];
  double r[3], L[3];
  for (int q = 0; q < 3; ++q) {
    a[q] = &sight.a[face.corner[q]];
    r[q] = sight.r[face.corner[q]];
    L[q] = sight.L[face.edge[q]];
  }
  const View view = ViewOf(face, a, r);
  const auto& [h, d] = view;
  touches |= std::abs(h) <= tolerance_ && d[0] >= -tolerance_ &&
             d[1] >= -tolerance_ && d[2] >= -tolerance_;
  const double omega = SolidAngle(face, view, a, r);
  for (int q = 0; q < 3; ++q) {
    const int p1 = (q + 1) % 3, p2 = (q + 2) % 3;
    const double logs =
        L[q] + face.cosine[p2] * L[p1] + face.cosine[p1] * L[p2];
    phi[face.corner[q]] +=
        face.length[q] / (4 * pi * face.area2) * (d[q] * omega + h * logs);
  }
  return (d[0] * L[0] + d[1] * L[1] + d[2] * L[2] - h * omega) / (4 * pi);
}

bool Green3d::Integrate(const Vec3& eta, std::span<double> phi,
                        std::span<double> psi) const {
  Sight sight;
  sight.a.resize(vertices_.rows());
  sight.r.resize(vertices_.rows());
  sight.L.resize(edges_.size());
  Look(eta, sight);
  std::fill(phi.begin(), phi.end(), 0);
  bool touches = false;
  for (size_t f = 0; f < faces_.size(); ++f) {
    psi[f] = IntegrateFace(faces_[f], sight, phi.data(), touches);
  }
  return touches;
}

}  // namespace

std::unique_ptr<const GreenIntegrals> MakeGreen3d(const Cage& cage) {
  return std::make_unique<Green3d>(cage);
}

}  // namespace deform
