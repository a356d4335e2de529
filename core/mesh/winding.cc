// Solid angles and angles without cancellation.
//
// Source: Van Oosterom, Strackee, "The Solid Angle of a Plane Triangle", IEEE
//   TBME 30(2), 1983: tan(Omega / 2) = det / den.
// Departs: close to an edge, and for slivers, det and den are both small
//   differences of large numbers; there the angle is the sum of one difference
//   of arcs per edge, which keeps 1e-10 down to 1e-9 D from an edge where the
//   formula above is 7e-5 off.
#include "core/mesh/winding.h"

#include <cmath>
#include <numbers>

#include "core/mesh/triangle.h"

namespace deform {
namespace {

// A triangle seen from the origin: corners a, distances r.
struct SeenTriangle {
  Vec3 a[3];
  double r[3];
};

// The solid angle by its edges. `normal` is the unit normal, h the height of
// the plane above the origin.
double SolidAngleByEdges(const SeenTriangle& t, const Vec3& normal, double h) {
  double sum = 0;
  for (int q = 0; q < 3; ++q) {
    const int i = (q + 1) % 3;
    const int j = (q + 2) % 3;
    const Vec3 along = (t.a[j] - t.a[i]).normalized();
    const Vec3 outward = along.cross(normal);
    const double d = outward.dot(t.r[i] < t.r[j] ? t.a[i] : t.a[j]);
    const double delta2 = d * d + h * h;
    const double x1 = t.a[i].dot(along);
    const double x2 = t.a[j].dot(along);
    sum += std::atan2(d * x2, delta2 + std::abs(h) * t.r[j]) -
           std::atan2(d * x1, delta2 + std::abs(h) * t.r[i]);
  }
  return std::copysign(std::abs(sum), h);
}

double SolidAngle(const Vec3& v0, const Vec3& v1, const Vec3& v2,
                  const Vec3& point) {
  // Differences of the inputs directly: exact when they are close.
  SeenTriangle t{{v0 - point, v1 - point, v2 - point}, {}};
  for (int k = 0; k < 3; ++k) t.r[k] = t.a[k].norm();
  const int nearest = t.r[0] <= t.r[1] ? (t.r[0] <= t.r[2] ? 0 : 2)
                                       : (t.r[1] <= t.r[2] ? 1 : 2);
  const Vec3 area = AreaVector(v0, v1, v2);
  const double det = t.a[nearest].dot(area);
  if (det == 0) return 0;
  const double den = t.r[0] * t.r[1] * t.r[2] + t.a[0].dot(t.a[1]) * t.r[2] +
                     t.a[1].dot(t.a[2]) * t.r[0] + t.a[2].dot(t.a[0]) * t.r[1];
  if (std::abs(det) + std::abs(den) >= 1e-3 * t.r[0] * t.r[1] * t.r[2]) {
    return 2 * std::atan2(det, den);
  }
  const double length = area.stableNorm();
  return SolidAngleByEdges(t, area / length, det / length);
}

double Angle(const Vec3& v0, const Vec3& v1, const Vec3& point) {
  const Vec3 b1 = v0 - point;
  const Vec3 b2 = v1 - point;
  const Vec3 a = v1 - v0;
  const Vec3& b = b1.squaredNorm() < b2.squaredNorm() ? b1 : b2;
  const double cross = b.x() * a.y() - b.y() * a.x();
  return cross == 0 ? 0 : std::atan2(cross, b1.dot(b2));
}

}  // namespace

double WindingNumber(const PositionsRef& vertices, const Faces& faces,
                     const Vec3& point, int64_t skip) {
  const bool planar = faces.cols() == 2;
  double sum = 0;
  for (int64_t f = 0; f < faces.rows(); ++f) {
    if (f == skip) continue;
    const Vec3 v0 = vertices.row(faces(f, 0));
    const Vec3 v1 = vertices.row(faces(f, 1));
    sum += planar ? Angle(v0, v1, point)
                  : SolidAngle(v0, v1, vertices.row(faces(f, 2)), point);
  }
  return sum / (planar ? 2 * std::numbers::pi : 4 * std::numbers::pi);
}

}  // namespace deform
