// Sums over dense weights.
#pragma once

#include <vector>

#include "core/deform/moved_columns.h"
#include "core/deform/weighted_sums.h"
#include "core/kernels/zeroed_array.h"

namespace deform {

// Kept in double over any number of steps. While a drag lasts (MovedColumns)
// they rest as they were at its beginning, and each step makes the sums of the
// present from them in float:
//
//   now = base + copied columns x what these moved since
class DenseSums : public WeightedSums {
 public:
  // Drags take memory of `copies`, borrowed.
  DenseSums(const WeightTiles& weights, Allowance& copies);
  bool PrefersAdding(std::span<const int32_t> columns) const override;
  void Copy(int64_t first, int64_t count, double* out) const override;

  // The sums of all changes are DenseSums.
  static void Apply(const WeightTiles& weights,
                    std::span<const SumsChange> changes, ThreadPool* pool);

 private:
  // A step of all columns of some sums, and of part of them.
  class FullStep;
  class PartialStep;

  bool dragging() const { return !shift_.empty(); }
  // Ends a drag: adds what it moved.
  void Settle(ThreadPool* pool);
  // Ends it and forgets what it moved.
  void DropDrag();

  const WeightTiles& weights_;
  ZeroedArray<double> sums_;  // tiles x kTileSums
  MovedColumns moved_;
  // While a drag lasts. `shift_`: 3 for each copied column.
  std::vector<double> shift_;
  ZeroedArray<float> base_, now_;  // tiles x kTileSums
};

}  // namespace deform
