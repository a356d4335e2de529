#include "core/deform/affine_map.h"

#include <cmath>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace deform {
namespace {

// In the plane the best rotation by angle a maximises sum q'.(R q): its
// cosine and sine are proportional to sum q.q' and sum q x q'.
Eigen::Matrix3d FitPlanar(const Positions& rest, const Positions& posed,
                          double variance) {
  const double c = rest.cwiseProduct(posed).sum() / variance;
  const double s = (rest.col(0).cwiseProduct(posed.col(1)) -
                    rest.col(1).cwiseProduct(posed.col(0)))
                       .sum() /
                   variance;
  Eigen::Matrix3d linear = Eigen::Matrix3d::Zero();
  linear.topLeftCorner<2, 2>() << c, -s, s, c;
  linear(2, 2) = std::hypot(c, s);
  return linear;
}

Eigen::Matrix3d FitSpatial(const Positions& rest, const Positions& posed,
                           double variance) {
  const Eigen::Matrix3d covariance = posed.transpose() * rest / variance;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vec3 signs = Vec3::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) {
    signs(2) = -1;
  }
  const double scale = svd.singularValues().dot(signs);
  return scale * svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace

PointMap PointMapOf(const AffineMap& map, const Vec3& origin) {
  PointMap from_origin;
  for (int d = 0; d < 3; ++d) {
    for (int k = 0; k < 3; ++k) from_origin.linear[d][k] = map.linear(d, k);
    from_origin.from[d] = map.from(d);
    from_origin.to[d] = map.to(d);
    from_origin.origin[d] = origin(d);
  }
  return from_origin;
}

AffineMap FitSimilarity(const PositionsRef& rest, const PositionsRef& posed,
                        int dimension) {
  AffineMap map;
  if (rest == posed) return map;
  map.from = rest.colwise().mean().transpose();
  map.to = posed.colwise().mean().transpose();
  Positions a = rest.rowwise() - map.from.transpose();
  Positions b = posed.rowwise() - map.to.transpose();
  // Powers of two change no digit and keep squares in range.
  const double rest_unit = std::exp2(std::ilogb(a.cwiseAbs().maxCoeff()));
  const double posed_size = b.cwiseAbs().maxCoeff();
  const double posed_unit =
      posed_size > 0 ? std::exp2(std::ilogb(posed_size)) : 1.0;
  a /= rest_unit;
  b /= posed_unit;
  const double variance = a.squaredNorm();
  map.linear =
      (posed_unit / rest_unit) *
      (dimension == 2 ? FitPlanar(a, b, variance) : FitSpatial(a, b, variance));
  return map;
}

}  // namespace deform
