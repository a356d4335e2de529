// Sums over dense weights.
#pragma once

#include <vector>

#include "core/deform/weighted_sums.h"

namespace deform {

class DenseSums : public WeightedSums {
 public:
  explicit DenseSums(const WeightTiles& weights);
  void Copy(int64_t first, int64_t count, double* out) const override;

  // The sums of all changes are DenseSums.
  static void Apply(const WeightTiles& weights,
                    std::span<const SumsChange> changes, ThreadPool* pool);

 private:
  std::vector<double> sums_;  // tiles x kTileSums
};

}  // namespace deform
