#include "core/weights/schemes/celestial_hull.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace deform {
namespace {

// The linear space that some offsets span: the first `rank` columns of `basis`,
// an orthonormal system.
struct Span {
  Eigen::Matrix3d basis;
  int rank = 0;

  // Coordinates of `v` in the space, and in what is orthogonal to it.
  Vec3 Within(const Vec3& v) const {
    Vec3 local = basis.transpose() * v;
    for (int k = rank; k < 3; ++k) local[k] = 0;
    return local;
  }
  Vec3 Across(const Vec3& v) const {
    Vec3 local = basis.transpose() * v;
    for (int k = 0; k < rank; ++k) local[k] = 0;
    return local;
  }
};

Vec3 OffsetOf(const Directions& q, int64_t i) { return q.q(i) * q.distance[i]; }

// Turns columns a and b of `offsets` in their plane until they are orthogonal,
// and `basis` with them. Returns whether there was anything to turn.
bool Orthogonalise(int a, int b, Positions& offsets, Eigen::Matrix3d& basis) {
  const double aa = offsets.col(a).squaredNorm();
  const double bb = offsets.col(b).squaredNorm();
  const double ab = offsets.col(a).dot(offsets.col(b));
  const double epsilon = std::numeric_limits<double>::epsilon();
  if (std::abs(ab) <= epsilon * std::sqrt(aa) * std::sqrt(bb)) return false;
  const double zeta = (bb - aa) / (2 * ab);
  const double t =
      std::copysign(1 / (std::abs(zeta) + std::hypot(1, zeta)), zeta);
  const double cosine = 1 / std::hypot(1, t);
  const auto turn = [&](auto& columns) {
    const auto left = columns.col(a).eval();
    columns.col(a) = cosine * left - cosine * t * columns.col(b);
    columns.col(b) = cosine * t * left + cosine * columns.col(b);
  };
  turn(offsets);
  turn(basis);
  return true;
}

// One-sided Jacobi, which keeps the digits of a narrow face's normal: products
// of offsets would halve them.
Span SpanOf(const Directions& q, std::span<const int64_t> handles,
            double tolerance) {
  Positions offsets(std::ssize(handles), 3);
  for (int64_t row = 0; row < offsets.rows(); ++row) {
    offsets.row(row) = OffsetOf(q, handles[row]);
  }
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  for (int sweep = 0; sweep < 30; ++sweep) {
    bool turned = Orthogonalise(0, 1, offsets, axes);
    turned |= Orthogonalise(0, 2, offsets, axes);
    turned |= Orthogonalise(1, 2, offsets, axes);
    if (!turned) break;
  }
  const Vec3 extent = offsets.colwise().norm().transpose();
  int order[3] = {0, 1, 2};
  std::sort(order, order + 3,
            [&](int a, int b) { return extent[a] > extent[b]; });
  Span span;
  const double noise =
      16 * tolerance * std::sqrt(static_cast<double>(offsets.rows()));
  for (int k = 0; k < 3; ++k) {
    span.basis.col(k) = axes.col(order[k]);
    if (extent[order[k]] > noise) ++span.rank;
  }
  return span;
}

// The handles in `span`, if a plane through it has all others on one side.
std::optional<HullFace> FaceIn(const Directions& q, const Span& span,
                               const Vec3& outward, double tolerance) {
  const Vec3 normal = span.Across(outward).normalized();
  if (normal.isZero(0)) return std::nullopt;
  HullFace face;
  for (int64_t i = 0; i < q.size(); ++i) {
    const Vec3 away = span.Across(OffsetOf(q, i));
    if (away.norm() <= tolerance) {
      face.handles.push_back(i);
    } else if (!(away.dot(normal) < -tolerance)) {
      return std::nullopt;
    }
  }
  face.directions.Resize(std::ssize(face.handles));
  for (int64_t k = 0; k < std::ssize(face.handles); ++k) {
    const Vec3 local = span.Within(OffsetOf(q, face.handles[k]));
    if (!face.directions.Set(k, local)) return std::nullopt;
  }
  return face;
}

}  // namespace

std::optional<HullFace> FindHullFace(const Directions& directions,
                                     std::span<const double> weights,
                                     const Vec3& outward, double tolerance) {
  const double largest = *std::max_element(weights.begin(), weights.end());
  // Handles of the face that are hardly used may be missed by a high threshold,
  // others be caught by a low one.
  size_t known = 0;
  for (const double threshold : {1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13}) {
    std::vector<int64_t> used;
    for (int64_t i = 0; i < directions.size(); ++i) {
      if (weights[i] > threshold * largest) used.push_back(i);
    }
    if (used.size() == known) continue;
    known = used.size();
    const Span span = SpanOf(directions, used, tolerance);
    if (span.rank == 0 || span.rank == 3) continue;
    auto face = FaceIn(directions, span, outward, tolerance);
    if (face) return face;
  }
  return std::nullopt;
}

}  // namespace deform
