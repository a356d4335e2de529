#include "core/deform/affine_map.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace deform {
namespace {

Positions RandomPoints(int count, int dimension) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Positions points = Positions::Zero(count, 3);
  for (int i = 0; i < count; ++i) {
    for (int d = 0; d < dimension; ++d) points(i, d) = uniform(random);
  }
  return points;
}

Eigen::Matrix3d Rotation(int dimension) {
  const Vec3 axis =
      dimension == 2 ? Vec3(0, 0, 1) : Vec3(Vec3(1, 2, -0.5).normalized());
  return Eigen::AngleAxisd(2.5, axis).toRotationMatrix();
}

Positions Moved(const Positions& points, const Eigen::Matrix3d& linear,
                const Vec3& offset) {
  Positions moved = points * linear.transpose();
  moved.rowwise() += offset.transpose();
  return moved;
}

class FitSimilarityTest : public testing::TestWithParam<int> {};

TEST_P(FitSimilarityTest, FindsTheSimilarityThatWasApplied) {
  const int dimension = GetParam();
  const Positions rest = RandomPoints(20, dimension);
  for (const double scale : {1e-30, 1e-6, 1.0, 3.0, 1e6, 1e30}) {
    const Eigen::Matrix3d linear = scale * Rotation(dimension);
    const Vec3 offset =
        scale * (dimension == 2 ? Vec3(5, -7, 0) : Vec3(5, -7, 11));
    const AffineMap map =
        FitSimilarity(rest, Moved(rest, linear, offset), dimension);
    for (int i = 0; i < rest.rows(); ++i) {
      const Vec3 x = rest.row(i).transpose();
      EXPECT_LT((map(x) - (linear * x + offset)).norm(), 1e-13 * scale);
    }
  }
}

TEST_P(FitSimilarityTest, IsTheIdentityToTheBitAtRest) {
  const Positions rest = RandomPoints(20, GetParam());
  const AffineMap map = FitSimilarity(rest, rest, GetParam());
  const Vec3 x(0.1, 0.2, 0);
  EXPECT_EQ(map(x), x);
}

TEST_P(FitSimilarityTest, NeverReflects) {
  const Positions rest = RandomPoints(20, GetParam());
  const Eigen::Matrix3d mirror = Vec3(-1, 1, 1).asDiagonal();
  const AffineMap map =
      FitSimilarity(rest, Moved(rest, mirror, Vec3::Zero()), GetParam());
  EXPECT_GE(map.linear.determinant(), 0);
}

TEST_P(FitSimilarityTest, IsFiniteWhenThePoseCollapses) {
  const Positions rest = RandomPoints(20, GetParam());
  Positions point = Positions::Constant(20, 3, 4.0);
  if (GetParam() == 2) point.col(2).setZero();
  const AffineMap map = FitSimilarity(rest, point, GetParam());
  EXPECT_TRUE(map.linear.isZero(0));
  Positions line = rest;
  line.rightCols<2>().setZero();
  EXPECT_TRUE(FitSimilarity(rest, line, GetParam()).linear.allFinite());
}

INSTANTIATE_TEST_SUITE_P(Dimensions, FitSimilarityTest, testing::Values(2, 3));

}  // namespace
}  // namespace deform
