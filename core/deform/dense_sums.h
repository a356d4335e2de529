// Sums over dense weights.
#pragma once

#include "core/deform/moved_columns.h"
#include "core/deform/weighted_sums.h"
#include "core/kernels/zeroed_array.h"

namespace deform {

class DenseSums : public WeightedSums {
 public:
  explicit DenseSums(const WeightTiles& weights);
  bool PrefersAdding(std::span<const int32_t> columns) const override;
  void Copy(int64_t first, int64_t count, double* out) const override;

  // The sums of all changes are DenseSums.
  static void Apply(const WeightTiles& weights,
                    std::span<const SumsChange> changes, ThreadPool* pool);

 private:
  // A step of part of the columns: tiles [first, first + count).
  struct Part;

  const WeightTiles& weights_;
  ZeroedArray<double> sums_;  // tiles x kTileSums
  MovedColumns moved_;
};

}  // namespace deform
