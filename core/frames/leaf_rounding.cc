#include "core/frames/leaf_rounding.h"

#include <algorithm>
#include <limits>

#include "core/kernels/apply_mixed.h"
#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

constexpr double kMostSteps = 1 << 30;
// Sums are compared in float; their rounding is less than this share.
constexpr double kOfTolerance = 1 - 1.0 / 1024;
// Blocks whose sums are made at once.
constexpr int64_t kStripBlocks = 8;

// Largest length of the sums of a leaf.
double LongestSum(const LeafBasis::Leaf& leaf, const float* coefficients) {
  float sums[kStripBlocks * kBlockTiles * kTileSums];
  float squares[kTilePoints] = {};
  for (int64_t first = 0; first < leaf.blocks; first += kStripBlocks) {
    const int64_t blocks = std::min(kStripBlocks, leaf.blocks - first);
    ApplyMixed(leaf.numbers + first * leaf.columns.block_bytes(), blocks,
               leaf.columns, coefficients, sums);
    for (int64_t t = 0; t < blocks * kBlockTiles; ++t) {
      const float* x = sums + t * kTileSums;
      const float* y = x + kTilePoints;
      const float* z = y + kTilePoints;
      for (int64_t i = 0; i < kTilePoints; ++i) {
        squares[i] =
            std::max(squares[i], x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
      }
    }
  }
  return std::sqrt(double{*std::max_element(squares, squares + kTilePoints)});
}

class LeafRounder {
 public:
  LeafRounder(const LeafBasis::Leaf& leaf, int dimension,
              const float* coefficients, double tolerance)
      : leaf_(leaf),
        dimension_(dimension),
        coefficients_(coefficients),
        unit_(UnitFor(tolerance)),
        tolerance_(tolerance),
        lost_(leaf.rows() * 3) {}

  // What rounding loses, in tolerances; infinity if steps are too many or too
  // large.
  double Round(int scale, std::vector<int32_t>& numbers) {
    numbers.resize(leaf_.rows() * dimension_);
    for (int64_t k = 0; k < leaf_.rows(); ++k) {
      const double step =
          CoefficientStep(unit_, scale, k == 0 ? 0 : leaf_.exponents[k - 1]);
      for (int d = 0; d < dimension_; ++d) {
        const double meant = coefficients_[k * 3 + d];
        const double steps = std::nearbyint(meant / step);
        const double told = static_cast<float>(steps * step);
        if (!(std::abs(steps) <= kMostSteps && std::isfinite(told))) {
          return std::numeric_limits<double>::infinity();
        }
        numbers[k * dimension_ + d] = static_cast<int32_t>(steps);
        lost_[k * 3 + d] = static_cast<float>((meant - told) / tolerance_);
      }
    }
    return LongestSum(leaf_, lost_.data()) / kOfTolerance;
  }

 private:
  const LeafBasis::Leaf& leaf_;
  const int dimension_;
  const float* const coefficients_;
  const double unit_;
  const double tolerance_;
  // rows() x 3, in tolerances: squares of model units may be no floats.
  std::vector<float> lost_;
};

// Where roundings that are as good as random come to the tolerance, about.
int LikelyScale(int64_t rows) {
  return static_cast<int>(4 * (16 - 2 + 0.5 - 0.5 * std::log2(rows)));
}

}  // namespace

bool RoundLeaf(const LeafBasis::Leaf& leaf, int dimension,
               const float* coefficients, double tolerance,
               RoundedLeaf& rounded) {
  constexpr int kTries = 4;
  LeafRounder rounder(leaf, dimension, coefficients, tolerance);
  std::vector<int32_t> numbers;
  int good = -1, bad = kMaxScale + 1;
  int scale = std::clamp(LikelyScale(leaf.rows()), 0, kMaxScale);
  for (int tries = 1;; ++tries) {
    const double lost = rounder.Round(scale, numbers);
    if (lost <= 1) {
      good = rounded.scale = scale;
      rounded.numbers.swap(numbers);
    } else {
      bad = scale;
    }
    if (lost == 0 || bad - good == 1) break;
    if (tries >= kTries && good >= 0) break;
    // Losses are about proportional to steps.
    const double further = std::floor(4 * std::log2(1 / lost));
    if (lost <= 1 && further < 1) break;  // The next would lose too much.
    scale = static_cast<int>(
        std::clamp<double>(scale + further, good + 1, bad - 1));
  }
  return good >= 0;
}

}  // namespace deform
