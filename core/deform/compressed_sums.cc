#include "core/deform/compressed_sums.h"

#include <algorithm>

#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

// Below this many points a loop is not worth sharing among threads.
constexpr int64_t kParallelPoints = 10000;

}  // namespace

CompressedSums::CompressedSums(const CompressedWeights& weights)
    : weights_(weights),
      top_(weights.top_size(), 0.0),
      sums_(weights.slot_count() * 3, 0.0F) {}

// Adding a column costs about as much as applying one.
bool CompressedSums::PrefersAdding(std::span<const int32_t> columns) const {
  return std::ssize(columns) * 2 <= weights_.columns();
}

void CompressedSums::Copy(int64_t first, int64_t count, double* out) const {
  for (int64_t i = first; i < first + count; ++i) {
    const int64_t slot = weights_.slot(i);
    const float* tile =
        sums_.data() + slot / kTilePoints * kTileSums + slot % kTilePoints;
    for (int64_t d = 0; d < 3; ++d) {
      *out++ = slot < 0 ? 0.0 : tile[d * kTilePoints];
    }
  }
}

void CompressedSums::ForEach(const CompressedWeights& weights, int64_t count,
                             ThreadPool* pool,
                             absl::FunctionRef<void(int64_t)> body) {
  const bool enough = weights.slot_count() > kParallelPoints;
  ParallelFor(enough ? pool : nullptr, count, nullptr, body);
}

std::vector<float> CompressedSums::LeafCoefficients(ThreadPool* pool) const {
  std::vector<int64_t> first_rows;  // Of the branches.
  int64_t rows = 0;
  for (int64_t b = 0; b < weights_.branch_count(); ++b) {
    first_rows.push_back(rows);
    rows += weights_.coefficient_rows(b);
  }
  std::vector<float> coefficients(rows * 3);
  ForEach(weights_, weights_.branch_count(), pool, [&](int64_t b) {
    weights_.CopyCoefficients(b, top_.data(),
                              coefficients.data() + first_rows[b] * 3);
  });
  return coefficients;
}

void CompressedSums::Apply(const CompressedWeights& weights,
                           std::span<const SumsChange> changes,
                           ThreadPool* pool) {
  const auto sums_of = [](const SumsChange& change) {
    return static_cast<CompressedSums*>(change.sums);
  };
  for (const SumsChange& change : changes) {
    if (change.full) std::ranges::fill(sums_of(change)->top_, 0.0);
  }
  ForEach(weights, weights.cluster_count(), pool, [&](int64_t cluster) {
    for (const SumsChange& change : changes) {
      weights.AddToTop(
          cluster, change.full ? nullptr : change.columns.data(),
          change.full ? weights.columns() : std::ssize(change.columns),
          change.values.data(), sums_of(change)->top_.data());
    }
  });
  ForEach(weights, weights.branch_count(), pool, [&](int64_t branch) {
    for (const SumsChange& change : changes) {
      weights.ApplyBranch(branch, sums_of(change)->top_.data(),
                          sums_of(change)->sums_.data());
    }
  });
}

}  // namespace deform
