#include "core/weights/cage_faces.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "core/mesh/triangle.h"

namespace deform {
namespace {

// The corner of `face` closest to x, relative to x.
Vec3 NearCorner(const CageFaces::Face& face, int corners, const Vec3& x) {
  Vec3 near = face.position[0] - x;
  for (int k = 1; k < corners; ++k) {
    const Vec3 a = face.position[k] - x;
    if (a.squaredNorm() < near.squaredNorm()) near = a;
  }
  return near;
}

// The point closest to the origin on the segment from a to b, as weights of
// both. Measured from the closer end, which keeps the digits.
struct OnSegment {
  double a, b;
  double distance;
};
OnSegment ClosestOnSegment(const Vec3& a, const Vec3& b) {
  if (b.squaredNorm() < a.squaredNorm()) {
    const OnSegment turned = ClosestOnSegment(b, a);
    return {turned.b, turned.a, turned.distance};
  }
  const Vec3 edge = b - a;
  const double t = std::max(0.0, -a.dot(edge) / edge.squaredNorm());
  return {1 - t, t, (a + t * edge).norm()};
}

CageFaces::Face Triangle(const Vec3 (&v)[3]) {
  CageFaces::Face face;
  const Vec3 area = AreaVector(v[0], v[1], v[2]);
  face.normal = area.normalized();
  for (int q = 0; q < 3; ++q) {
    const Vec3 edge = v[(q + 2) % 3] - v[(q + 1) % 3];
    face.position[q] = v[q];
    face.m[q] = edge.normalized().cross(face.normal);
    face.height[q] = area.norm() / edge.norm();
  }
  return face;
}

CageFaces::Face Segment(const Vec3& v0, const Vec3& v1) {
  CageFaces::Face face;
  const double length = (v1 - v0).norm();
  const Vec3 t = (v1 - v0) / length;
  face.position[0] = v0;
  face.position[1] = v1;
  face.normal = Vec3(t.y(), -t.x(), 0);
  face.m[0] = t;
  face.m[1] = -t;
  face.height[0] = face.height[1] = length;
  return face;
}

}  // namespace

CageFaces::CageFaces(const Cage& cage) : corners_(cage.dimension()) {
  faces_.reserve(cage.face_count());
  for (int64_t f = 0; f < cage.face_count(); ++f) {
    Vec3 v[3];
    for (int k = 0; k < corners_; ++k) {
      v[k] = cage.vertices().row(cage.faces()(f, k));
    }
    faces_.push_back(corners_ == 3 ? Triangle(v) : Segment(v[0], v[1]));
    Face& face = faces_.back();
    face.center.setZero();
    for (int k = 0; k < 3; ++k) {
      face.corner[k] = k < corners_ ? cage.faces()(f, k) : -1;
      if (k < corners_) face.center += (v[k] - v[0]) / corners_;
    }
    face.radius = 0;
    for (int k = 0; k < corners_; ++k) {
      face.radius = std::max(face.radius, (v[k] - v[0] - face.center).norm());
    }
  }
}

double CageFaces::Height(int64_t f, const Vec3& x) const {
  const Face& face = faces_[f];
  return -face.normal.dot(NearCorner(face, corners_, x));
}

Vec3 CageFaces::Barycentric(int64_t f, const Vec3& x) const {
  const Face& face = faces_[f];
  Vec3 lambda = Vec3::Zero();
  for (int q = 0; q < corners_; ++q) {
    Vec3 a = face.position[(q + 1) % corners_] - x;
    if (corners_ == 3) {  // The closer end of edge q keeps the digits.
      const Vec3 b = face.position[(q + 2) % 3] - x;
      if (b.squaredNorm() < a.squaredNorm()) a = b;
    }
    lambda[q] = face.m[q].dot(a) / face.height[q];
  }
  return lambda;
}

CageFaces::Nearest CageFaces::NearestOn(int64_t f, const Vec3& x) const {
  const Face& face = faces_[f];
  Nearest nearest{.face = f};
  if (corners_ == 3) {
    const Vec3 lambda = Barycentric(f, x);
    if (lambda.minCoeff() >= 0) {
      nearest.distance = std::abs(Height(f, x));
      nearest.barycentric = lambda / lambda.sum();
      return nearest;
    }
  }
  for (int q = 0; q < (corners_ == 3 ? 3 : 1); ++q) {
    const int from = q, to = (q + 1) % corners_;
    const OnSegment closest =
        ClosestOnSegment(face.position[from] - x, face.position[to] - x);
    if (closest.distance < nearest.distance) {
      nearest.distance = closest.distance;
      nearest.barycentric.setZero();
      nearest.barycentric[from] = closest.a;
      nearest.barycentric[to] = closest.b;
    }
  }
  return nearest;
}

bool CageFaces::MayBeWithin(double distance, int64_t f, const Vec3& x) const {
  const Face& face = faces_[f];
  const double to_center = (face.position[0] - x + face.center).norm();
  // Rounding must not rule out a face.
  return to_center * (1 - 1e-9) <= distance + face.radius * (1 + 1e-9);
}

CageFaces::Nearest CageFaces::NearestWithin(const Vec3& x,
                                            double distance) const {
  Nearest nearest{.distance = distance};
  for (int64_t f = 0; f < size(); ++f) {
    if (!MayBeWithin(nearest.distance, f, x)) continue;
    const Nearest candidate = NearestOn(f, x);
    if (candidate.distance < nearest.distance) nearest = candidate;
  }
  return nearest;
}

CageFaces::Nearest CageFaces::NearestOf(const Vec3& x,
                                        std::span<const char> allowed) const {
  Nearest nearest;
  for (int64_t f = 0; f < size(); ++f) {
    if (!allowed.empty() && !allowed[f]) continue;
    if (!MayBeWithin(nearest.distance, f, x)) continue;
    const Nearest candidate = NearestOn(f, x);
    if (candidate.distance < nearest.distance) nearest = candidate;
  }
  return nearest;
}

}  // namespace deform
