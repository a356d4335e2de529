#include "core/weights/leaf_fit.h"

#include <gtest/gtest.h>

#include <cmath>

namespace deform {
namespace {

// Weights of `points` points that are combinations of two rows; the second
// coefficient is the same everywhere.
LeafRows TwoRows(int64_t points) {
  LeafRows leaf{.weights = Tiles<double>(points, 3),
                .coefficients = Tiles<double>(points, 2),
                .branch_basis = RowMatrix(2, 3),
                .tolerance = 1e-3,
                .first_budget = 1e-3};
  leaf.branch_basis << 1, 0, 0.5, 0, 1, -0.25;
  for (int64_t i = 0; i < points; ++i) {
    const double first = std::sin(0.1 * static_cast<double>(i));
    const double second = 0.75;
    leaf.coefficients.set(i, 0, first);
    leaf.coefficients.set(i, 1, second);
    for (int64_t c = 0; c < 3; ++c) {
      leaf.weights.set(
          i, c,
          first * leaf.branch_basis(0, c) + second * leaf.branch_basis(1, c));
    }
  }
  return leaf;
}

// What the fit gives back, at the largest distance from what was to be.
double LargestError(const LeafRows& leaf, const LeafFit& fit) {
  double largest = 0;
  for (int64_t i = 0; i < leaf.weights.points(); ++i) {
    const std::byte* const block =
        fit.numbers.data() + i / kBlockPoints * fit.columns.block_bytes();
    RowMatrix row = fit.rows.row(0);
    for (int64_t k = 0; k < fit.columns.count(); ++k) {
      const double unit = k < fit.columns.floats ? 1 : fit.step;
      row += unit * MixedNumber(block, fit.columns, k, i % kBlockPoints) *
             fit.rows.row(1 + k);
    }
    const RowMatrix weights = row * leaf.branch_basis;
    for (int64_t c = 0; c < weights.cols(); ++c) {
      largest =
          std::max(largest, std::abs(weights(0, c) - leaf.weights.at(i, c)));
    }
  }
  return largest;
}

TEST(FitLeaf, KeepsTheToleranceWithFewIntegers) {
  const LeafRows leaf = TwoRows(100);
  const LeafFit fit = FitLeaf(leaf);
  EXPECT_LE(fit.excess, 1);
  EXPECT_LE(fit.bound, leaf.tolerance);
  EXPECT_LE(LargestError(leaf, fit), fit.bound);
  // What is the same everywhere is no column.
  EXPECT_EQ(fit.columns.count(), 1);
  EXPECT_EQ(fit.columns.floats, 0);
}

TEST(FitLeaf, ExactlyAlsoWhereAColumnIsAllZeros) {
  LeafRows leaf = TwoRows(100);
  leaf.exact = true;
  const LeafFit fit = FitLeaf(leaf);
  EXPECT_EQ(fit.step, 0);
  EXPECT_EQ(fit.columns.count(), 2);
  EXPECT_EQ(fit.columns.floats, 1);
  EXPECT_LE(LargestError(leaf, fit), 1e-7);
}

}  // namespace
}  // namespace deform
