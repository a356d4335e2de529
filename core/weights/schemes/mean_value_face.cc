#include "core/weights/schemes/mean_value_face.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace deform {
namespace {

using Face = CageFaces::Face;

// What one edge of a triangle contributes; the edge is opposite corner q.
struct EdgeView {
  double d;       // Distance of eta from the edge's line within the plane, > 0
                  // on the inner side.
  double x1, x2;  // Its ends along its direction, from eta's foot.
  double delta;   // Distance of eta from its line.
  double theta;   // Angle under which it is seen.
};

// S = (sum theta d / delta) / h. Over the face all terms are positive; beside
// it, close to its plane, they cancel: there what they are in the plane, which
// is 0 in sum, is subtracted from each.
double PlaneSum(const std::array<EdgeView, 3>& edges, double h, double size) {
  const bool over = std::all_of(edges.begin(), edges.end(),
                                [](const EdgeView& e) { return e.d > 0; });
  double sum = 0;
  if (over || std::abs(h) >= 0.05 * size) {
    for (const EdgeView& e : edges) sum += e.theta * (e.d / e.delta);
    return sum / h;
  }
  const double h2 = h * h;
  for (const EdgeView& e : edges) {
    const double d = std::abs(e.d);
    // atan(x / d) - atan(x / delta)
    const auto more = [&](double x) {
      return std::atan2(x * h2, (e.delta + d) * (d * e.delta + x * x));
    };
    const double missing =
        e.theta * h2 / (e.delta * (e.delta + d)) + more(e.x2) - more(e.x1);
    sum += e.d > 0 ? -missing : missing;
  }
  return sum / h;
}

}  // namespace

std::array<double, 3> MeanValueOfEdge(const Face& edge, const Vec3& eta) {
  const Vec3 a = edge.position[1] - edge.position[0];
  const Vec3 b1 = edge.position[0] - eta;
  const Vec3 b2 = edge.position[1] - eta;
  const double r1 = b1.norm();
  const double r2 = b2.norm();
  const double cross = (r1 < r2 ? b1 : b2).cross(a).z();
  const double dot = b1.dot(b2);
  // tan of half the angle under which the edge is seen.
  const double tangent =
      dot >= 0 ? cross / (r1 * r2 + dot) : (r1 * r2 - dot) / cross;
  return {tangent / r1, tangent / r2, 0};
}

std::array<double, 3> MeanValueOfTriangle(const Face& face, const Vec3& eta) {
  std::array<Vec3, 3> a;
  std::array<double, 3> r;
  for (int k = 0; k < 3; ++k) {
    a[k] = face.position[k] - eta;
    r[k] = a[k].norm();
  }
  const auto nearest = std::min_element(r.begin(), r.end()) - r.begin();
  const double size = *std::max_element(r.begin(), r.end());
  const double h = face.normal.dot(a[nearest]);
  // In its plane, outside it, a face is seen edge on.
  if (std::abs(h) <= 4e-16 * size) return {};
  std::array<EdgeView, 3> edges;
  for (int k = 0; k < 3; ++k) {
    const int from = (k + 1) % 3;
    const int to = (k + 2) % 3;
    const Vec3 edge = face.position[to] - face.position[from];
    const double l = edge.norm();
    EdgeView& e = edges[k];
    e.d = face.m[k].dot(a[r[from] < r[to] ? from : to]);
    e.x1 = edge.dot(a[from]) / l;
    e.x2 = edge.dot(a[to]) / l;
    e.delta = std::hypot(e.d, h);
    e.theta = std::atan2(e.delta * l, e.delta * e.delta + e.x1 * e.x2);
  }
  const double sum = PlaneSum(edges, h, size);
  std::array<double, 3> shares;
  for (int k = 0; k < 3; ++k) {
    double across = 0;
    for (int q = 0; q < 3; ++q) {
      across += edges[q].theta / edges[q].delta * face.m[k].dot(face.m[q]);
    }
    shares[k] = (edges[k].d * sum + h * across) / face.height[k];
  }
  return shares;
}

}  // namespace deform
