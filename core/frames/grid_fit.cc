#include "core/frames/grid_fit.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/LU>

namespace deform {
namespace {

// Bits of magnitude that SumMoments() can sum, and that a place has in a
// prediction: three products with 15 bits of a gradient stay within 32.
constexpr int kMomentBits = 11;
constexpr int kPlaceBits = 14;

// Leaves room for the half that a prediction is rounded with.
constexpr int kMaxFraction = 29;

// How far to shift so that magnitudes of `extent` keep `bits` bits.
int ShiftTo(int bits, uint32_t extent) {
  return std::max(0, static_cast<int>(std::bit_width(extent)) - bits);
}

// Gradients of one coordinate, as integers.
struct Rounded {
  int32_t gradient[3] = {};
  int32_t fraction = 0;
  int bytes = 0;
};

// With `shift` and an extent of places, all in steps.
Rounded Round(const Eigen::Vector3d& gradient, int shift, double extent) {
  const double largest = gradient.cwiseAbs().maxCoeff();
  // A block in which they differ by less than this needs none.
  constexpr double kWorthIt = 0.5;
  if (!(largest * extent > kWorthIt)) return {};
  for (const int bytes : {1, 2}) {
    const double limit = bytes == 1 ? 127 : 32767;
    // The largest power of two that keeps them below the limit.
    int power = 0;
    std::frexp(limit / largest, &power);
    const int fraction = std::min(power - 1 - shift, kMaxFraction);
    if (fraction < 0) continue;
    // Half a unit of each, at the end of the block.
    const double error = extent * std::ldexp(0.5, -(fraction + shift));
    if (bytes == 1 && error > 0.5) continue;
    Rounded rounded{.fraction = fraction, .bytes = bytes};
    for (int k = 0; k < 3; ++k) {
      rounded.gradient[k] = static_cast<int32_t>(
          std::lrint(std::ldexp(gradient[k], fraction + shift)));
    }
    return rounded;
  }
  return {};  // Steeper than 16 bits can say: a block torn apart.
}

}  // namespace

BlockFit FitBlock(const GridBlock& reference, const GridBlock& grid) {
  const GridExtent extent = MeasureExtent(reference, grid);
  const uint32_t places = extent.place[0] | extent.place[1] | extent.place[2];
  const int place_shift = ShiftTo(kMomentBits, places);
  int motion_shift[3];
  for (int d = 0; d < 3; ++d) {
    motion_shift[d] = ShiftTo(kMomentBits, extent.motion[d]);
  }
  const GridMoments sums =
      SumMoments(reference, grid, place_shift, motion_shift);

  constexpr double kCount = kGridBlock;
  Eigen::Matrix3d covariance;
  for (int k = 0; k < 3; ++k) {
    for (int l = k; l < 3; ++l) {
      covariance(k, l) = covariance(l, k) =
          sums.place_products[k][l] -
          double{1} * sums.places[k] * sums.places[l] / kCount;
    }
  }
  // What rounding places to integers adds, so that flat blocks have a solution.
  covariance.diagonal().array() += kCount / 4;
  const Eigen::Matrix3d inverse = covariance.inverse();

  BlockFit fit;
  for (int d = 0; d < 3; ++d) {
    Eigen::Vector3d products;
    for (int k = 0; k < 3; ++k) {
      products[k] = sums.motion_products[d][k] -
                    double{1} * sums.motions[d] * sums.places[k] / kCount;
    }
    const Eigen::Vector3d gradient =
        inverse * products * std::ldexp(1.0, motion_shift[d] - place_shift);
    const int shift = ShiftTo(kPlaceBits, places);
    const Rounded rounded = Round(gradient, shift, places);
    GridPrediction& prediction = fit.of[d];
    prediction.shift = shift;
    prediction.fraction = rounded.fraction;
    fit.gradient_bytes[d] = rounded.bytes;
    double offset = grid.of[d][0] - reference.of[d][0] +
                    std::ldexp(sums.motions[d] / kCount, motion_shift[d]);
    for (int k = 0; k < 3; ++k) {
      prediction.gradient[k] = rounded.gradient[k];
      offset -= std::ldexp(rounded.gradient[k] * (sums.places[k] / kCount),
                           place_shift - shift - rounded.fraction);
    }
    // Of places within kGridLimit, it is far smaller than this.
    constexpr double kLargest = 1 << 30;
    prediction.offset = static_cast<int32_t>(
        std::lrint(std::clamp(offset, -kLargest, kLargest)));
  }
  return fit;
}

}  // namespace deform
