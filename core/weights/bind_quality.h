// Figures of how a binding came out, gathered row by row.
#pragma once

#include <cstdint>

namespace deform {

// Over the bound points, of the weights as they are cached.
struct BindQuality {
  // Largest |sum phi v + sum psi n - eta|, in units of D: rounding to float
  // alone makes about 1e-7 of it, times the sum of |weight|. Positions count
  // from the middle of the rig.
  double reproduction_error = 0;
  // Largest |sum phi - 1|; again about 1e-7 times the sum of |weight|.
  double partition_error = 0;
  // Smallest and largest vertex weight, and largest sum of |vertex weight| of a
  // point. 0 if no point is bound.
  double weight_min = 0;
  double weight_max = 0;
  double weight_sum_max = 0;
  // Iterative schemes: steps of all points, of the slowest and on average. Of
  // celestial coordinates, |sum beta q| / sum beta where the search ended.
  int64_t iterations_total = 0;
  int iterations_max = 0;
  double iterations_mean = 0;
  double residual_max = 0;
  double residual_mean = 0;
};

// Adds up the rows of some points. Merging does not depend on the order (the
// mean residual by rounding only), so neither do the figures on the threads.
class QualityTally {
 public:
  // The figures of one point's row; those of searches are 0.
  void AddRow(const BindQuality& row);
  void AddSearch(int iterations, double residual);
  void Merge(const QualityTally& other);

  BindQuality quality() const;

 private:
  BindQuality quality_;  // Without the means.
  int64_t rows_ = 0;
  int64_t searches_ = 0;
  double residual_sum_ = 0;
};

}  // namespace deform
