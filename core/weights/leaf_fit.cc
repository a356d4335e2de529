#include "core/weights/leaf_fit.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/kernels/multiply_tiles.h"
#include "core/weights/row_basis.h"

namespace deform {
namespace {

// Of a row's error the quantisation may have this fraction.
constexpr double kQuantisationShare = 0.3;
// Tries to meet the tolerance, and a fit this close to it is not made coarser.
constexpr int kAttempts = 6;
constexpr double kCloseEnough = 0.8;
// Roundings to float (2^-24) that the sum of a row's terms carries when it is
// deformed with, in units of the sum of the terms' largest sizes.
constexpr double kRoundings = 3;

// Rounded as stored.
RowMatrix AsFloat(const RowMatrix& matrix) {
  return matrix.cast<float>().cast<double>();
}

class LeafFitter {
 public:
  explicit LeafFitter(const LeafRows& leaf) : leaf_(leaf) {
    TakeMeanOut();
    if (leaf.exact) {
      principal_.axes = RowMatrix::Identity(rank(), rank());
      principal_.rows = std::move(centred_);
    } else {
      principal_ = InPrincipalAxes(centred_, 0.02 * leaf.first_budget);
    }
    principal_.axes = AsFloat(principal_.axes);
    RowMatrix rows(1 + principal_.axes.rows(), rank());
    rows << mean_, principal_.axes;
    effects_ = -(rows * leaf.branch_basis);
  }

  LeafFit WithBudget(double budget) const;

 private:
  int64_t points() const { return leaf_.weights.points(); }
  int64_t rank() const { return leaf_.coefficients.columns(); }
  void TakeMeanOut();
  // Which of the leading columns are stored, and how.
  std::vector<int64_t> Sort(int64_t columns, LeafFit& fit) const;
  void Pack(const std::vector<int64_t>& sorted, LeafFit& fit) const;
  void Prove(const std::vector<int64_t>& sorted, LeafFit& fit) const;

  const LeafRows& leaf_;
  RowMatrix mean_;         // 1 x r, float numbers.
  Tiles<double> centred_;  // Coefficients without it; padding stays 0.
  PrincipalRows principal_;
  RowMatrix effects_;  // -(mean; axes) branch_basis: (1 + k) x C.
};

void LeafFitter::TakeMeanOut() {
  centred_ = Tiles<double>(points(), rank());
  mean_ = RowMatrix::Zero(1, rank());
  for (int64_t k = 0; k < rank(); ++k) {
    for (int64_t i = 0; i < points(); ++i) {
      mean_(k) += leaf_.coefficients.at(i, k);
    }
  }
  mean_ = AsFloat(mean_ / static_cast<double>(points()));
  for (int64_t k = 0; k < rank(); ++k) {
    for (int64_t i = 0; i < points(); ++i) {
      centred_.set(i, k, leaf_.coefficients.at(i, k) - mean_(k));
    }
  }
}

std::vector<int64_t> LeafFitter::Sort(int64_t columns, LeafFit& fit) const {
  std::vector<int64_t> kinds[3];
  for (int64_t k = 0; k < columns; ++k) {
    double largest = 0;
    for (int64_t i = 0; i < points(); ++i) {
      largest = std::max(largest, std::abs(principal_.rows.at(i, k)));
    }
    const bool shorts = largest <= 32767 * fit.step;
    const bool bytes = largest <= 127 * fit.step;
    kinds[bytes ? 2 : shorts ? 1 : 0].push_back(k);
  }
  fit.columns = {.floats = std::ssize(kinds[0]),
                 .shorts = std::ssize(kinds[1]),
                 .bytes = std::ssize(kinds[2])};
  std::vector<int64_t> sorted = kinds[0];
  sorted.insert(sorted.end(), kinds[1].begin(), kinds[1].end());
  sorted.insert(sorted.end(), kinds[2].begin(), kinds[2].end());
  return sorted;
}

template <typename Number>
void Put(double value, std::byte* to) {
  const auto number = static_cast<Number>(value);
  std::memcpy(to, &number, sizeof(number));
}

void LeafFitter::Pack(const std::vector<int64_t>& sorted, LeafFit& fit) const {
  const MixedColumns& columns = fit.columns;
  // Without a step, only columns of zeros are integers.
  const auto steps = [&](double value) {
    return fit.step > 0 ? std::round(value / fit.step) : 0;
  };
  const int64_t blocks = (points() + kBlockPoints - 1) / kBlockPoints;
  fit.numbers.assign(blocks * columns.block_bytes(), std::byte{0});
  for (int64_t i = 0; i < points(); ++i) {
    std::byte* block =
        fit.numbers.data() + i / kBlockPoints * columns.block_bytes();
    const int64_t in_block = i % kBlockPoints;
    for (int64_t k = 0; k < columns.count(); ++k) {
      const double value = principal_.rows.at(i, sorted[k]);
      if (k < columns.floats) {
        Put<float>(value, block + 4 * in_block);
        block += 4 * kBlockPoints;
      } else if (k < columns.floats + columns.shorts) {
        Put<int16_t>(steps(value), block + 2 * in_block);
        block += 2 * kBlockPoints;
      } else {
        Put<int8_t>(steps(value), block + in_block);
        block += kBlockPoints;
      }
    }
  }
}

// From what was stored, not from what was meant.
void LeafFitter::Prove(const std::vector<int64_t>& sorted, LeafFit& fit) const {
  const MixedColumns& columns = fit.columns;
  const int64_t all = effects_.cols();
  RowMatrix effects(1 + columns.count(), all);
  effects.row(0) = effects_.row(0);
  Tiles<double> factors(points(), effects.rows());
  for (int64_t k = 0; k < columns.count(); ++k) {
    effects.row(1 + k) = effects_.row(1 + sorted[k]);
  }
  for (int64_t i = 0; i < points(); ++i) {
    const std::byte* block =
        fit.numbers.data() + i / kBlockPoints * columns.block_bytes();
    factors.set(i, 0, 1);
    for (int64_t k = 0; k < columns.count(); ++k) {
      const double unit = k < columns.floats ? 1 : fit.step;
      factors.set(i, 1 + k,
                  unit * MixedNumber(block, columns, k, i % kBlockPoints));
    }
  }
  // What a term may come to in a pose within the bounds.
  const Eigen::VectorXd sizes = effects.cwiseAbs().rowwise().sum();
  std::vector<double> errors(all * kTilePoints);
  fit.excess = fit.bound = 0;
  for (int64_t t = 0; t < factors.tiles(); ++t) {
    const double* weights = leaf_.weights.tile(t);
    std::copy_n(weights, errors.size(), errors.begin());
    AddTileProducts(factors.tile(t), 1, effects.rows(), effects.data(), all,
                    errors.data());
    double error[kTilePoints] = {};
    for (int64_t c = 0; c < all; ++c) {
      for (int64_t i = 0; i < kTilePoints; ++i) {
        error[i] += std::abs(errors[c * kTilePoints + i]);
      }
    }
    const int64_t rows = std::min(kTilePoints, points() - t * kTilePoints);
    for (int64_t i = 0; i < rows; ++i) {
      double terms = 0;
      for (int64_t k = 0; k < sizes.size(); ++k) {
        terms += std::abs(factors.tile(t)[k * kTilePoints + i]) * sizes[k];
      }
      const double rounding = kRoundings * std::ldexp(terms, -24);
      // No more is asked than float can do.
      const double limit = std::max(leaf_.tolerance - rounding, rounding);
      fit.excess = std::max(fit.excess, error[i] / limit);
      fit.bound = std::max(fit.bound, error[i] + rounding);
    }
  }
}

LeafFit LeafFitter::WithBudget(double budget) const {
  LeafFit fit;
  const int64_t columns =
      leaf_.exact ? rank() : RankWithin(principal_.rows, budget);
  fit.step = leaf_.exact ? 0
                         : budget * std::sqrt(12.0) * kQuantisationShare /
                               std::sqrt(std::max<double>(1, columns));
  const std::vector<int64_t> sorted = Sort(columns, fit);
  Pack(sorted, fit);
  Prove(sorted, fit);
  fit.rows.resize(1 + columns, rank());
  fit.rows.row(0) = mean_;
  for (int64_t k = 0; k < columns; ++k) {
    fit.rows.row(1 + k) = principal_.axes.row(sorted[k]);
  }
  return fit;
}

}  // namespace

LeafFit FitLeaf(const LeafRows& leaf) {
  const LeafFitter fitter(leaf);
  double budget = leaf.first_budget;
  LeafFit best = fitter.WithBudget(budget);
  double excess = best.excess;
  for (int attempt = 1; attempt < kAttempts && !leaf.exact; ++attempt) {
    if (excess >= kCloseEnough && excess <= 1) break;
    // Errors are about proportional to the budget.
    budget *= std::clamp(0.95 / excess, 0.1, 3.0);
    LeafFit next = fitter.WithBudget(budget);
    excess = next.excess;
    const bool better = excess <= 1 ? best.excess > 1 || next.numbers.size() <
                                                             best.numbers.size()
                                    : excess < best.excess;
    if (better) best = std::move(next);
  }
  return best;
}

}  // namespace deform
