#include "core/deform/weighted_sums.h"

#include "core/deform/compressed_sums.h"
#include "core/deform/dense_sums.h"

namespace deform {

std::unique_ptr<WeightedSums> WeightedSums::Create(const Binding& binding,
                                                   Allowance& copies) {
  if (const CompressedWeights* compressed = binding.compressed()) {
    return std::make_unique<CompressedSums>(*compressed);
  }
  return std::make_unique<DenseSums>(binding.weights(), copies);
}

void ApplyChanges(const Binding& binding, std::span<const SumsChange> changes,
                  ThreadPool* pool) {
  if (changes.empty()) return;
  if (const CompressedWeights* compressed = binding.compressed()) {
    CompressedSums::Apply(*compressed, changes, pool);
  } else {
    DenseSums::Apply(binding.weights(), changes, pool);
  }
}

}  // namespace deform
