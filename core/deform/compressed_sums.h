// Sums over compressed weights.
#pragma once

#include <vector>

#include "absl/functional/function_ref.h"
#include "core/deform/weighted_sums.h"

namespace deform {

// Keeps the sums of the coarsest level in double, which follow moved columns
// alone; those of the points are made from them at every change.
class CompressedSums : public WeightedSums {
 public:
  explicit CompressedSums(const CompressedWeights& weights);
  bool PrefersAdding(std::span<const int32_t> columns) const override;
  void Copy(int64_t first, int64_t count, double* out) const override;
  std::vector<float> LeafCoefficients(ThreadPool* pool) const override;

  // The sums of all changes are CompressedSums.
  static void Apply(const CompressedWeights& weights,
                    std::span<const SumsChange> changes, ThreadPool* pool);

 private:
  // Calls body(i), on the pool if there is enough to do.
  static void ForEach(const CompressedWeights& weights, int64_t count,
                      ThreadPool* pool, absl::FunctionRef<void(int64_t)> body);

  const CompressedWeights& weights_;
  std::vector<double> top_;
  std::vector<float> sums_;  // By slot, in tiles.
};

}  // namespace deform
