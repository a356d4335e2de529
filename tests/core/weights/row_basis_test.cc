#include "core/weights/row_basis.h"

#include <gtest/gtest.h>

#include <random>

#include "core/weights/point_clusters.h"

namespace deform {
namespace {

// Rows in the span of `rank` directions, each ten times shorter than the one
// before.
RowMatrix LowRankRows(int64_t rows, int64_t columns, int64_t rank) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  const auto matrix = [&](int64_t n, int64_t m) {
    return RowMatrix::NullaryExpr(n, m, [&] { return normal(random); }).eval();
  };
  RowMatrix left = matrix(rows, rank);
  for (int64_t k = 0; k < rank; ++k) left.col(k) *= std::pow(10.0, -k);
  return left * matrix(rank, columns);
}

TEST(ExtendBasis, FindsOrthonormalDirectionsWithinTheThreshold) {
  const RowMatrix rows = LowRankRows(60, 30, 12);
  for (const double threshold : {1e-1, 1e-4, 1e-8}) {
    RowMatrix basis(0, 30);
    // The second call goes on where the digits of the first end.
    ExtendBasis(rows, threshold, basis);
    ExtendBasis(rows, threshold, basis);
    EXPECT_LE(basis.rows(), 12);
    EXPECT_TRUE(
        (basis * basis.transpose())
            .isApprox(RowMatrix::Identity(basis.rows(), basis.rows()), 1e-12));
    const RowMatrix left = rows - rows * basis.transpose() * basis;
    EXPECT_LE(left.rowwise().norm().maxCoeff(), 1.01 * threshold);
  }
}

TEST(ExtendBasis, AddsNothingToABasisThatSuffices) {
  const RowMatrix rows = LowRankRows(40, 20, 5);
  RowMatrix basis(0, 20);
  ExtendBasis(rows, 1e-9, basis);
  const RowMatrix before = basis;
  ExtendBasis(rows.topRows(10), 1e-9, basis);
  EXPECT_EQ(basis, before);
}

TEST(InPrincipalAxes, KeepsRowsButForWhatIsNegligible) {
  const RowMatrix rows = LowRankRows(50, 17, 9);
  Tiles<double> tiles(50, 17);
  for (int64_t i = 0; i < 50; ++i) {
    for (int64_t c = 0; c < 17; ++c) tiles.set(i, c, rows(i, c));
  }
  const PrincipalRows principal = InPrincipalAxes(tiles, 1e-5);
  EXPECT_LT(principal.axes.rows(), 9);
  const int64_t rank = RankWithin(principal.rows, 1e-3);
  EXPECT_LT(rank, principal.axes.rows());
  for (int64_t i = 0; i < 50; ++i) {
    Eigen::RowVectorXd all = Eigen::RowVectorXd::Zero(17), leading = all;
    for (int64_t k = 0; k < principal.axes.rows(); ++k) {
      all += principal.rows.at(i, k) * principal.axes.row(k);
      if (k < rank) leading = all;
    }
    EXPECT_LE((rows.row(i) - all).norm(), 1e-5);
    EXPECT_LE((rows.row(i) - leading).norm(), 1e-3 + 1e-5);
  }
}

TEST(CutIntoClusters, MakesEvenRangesAtMultiplesOfTheUnit) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Positions points =
      Positions::NullaryExpr(1000, 3, [&] { return uniform(random); });
  std::vector<int32_t> order(1000);
  for (int32_t i = 0; i < 1000; ++i) order[i] = i;
  const auto clusters = CutIntoClusters(points, 5, 64, {0, 1000}, order);
  ASSERT_EQ(clusters.size(), 5u);
  int64_t next = 0;
  for (const Block& cluster : clusters) {
    EXPECT_EQ(cluster.first, next);
    EXPECT_EQ(cluster.first % 64, 0);
    EXPECT_NEAR(static_cast<double>(cluster.count), 200, 64);
    next += cluster.count;
  }
  EXPECT_EQ(next, 1000);
  std::sort(order.begin(), order.end());
  for (int32_t i = 0; i < 1000; ++i) EXPECT_EQ(order[i], i);
}

TEST(CutIntoClusters, MakesNoMoreThanThereAreUnits) {
  const Positions points = Positions::Zero(70, 3);
  std::vector<int32_t> order(70);
  for (int32_t i = 0; i < 70; ++i) order[i] = i;
  EXPECT_EQ(CutIntoClusters(points, 9, 64, {0, 70}, order).size(), 2u);
  EXPECT_TRUE(CutIntoClusters(points, 9, 64, {0, 0}, order).empty());
}

}  // namespace
}  // namespace deform
