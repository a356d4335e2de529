#include "core/deform/dense_sums.h"

#include <algorithm>
#include <vector>

#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

// Tiles that one body of a parallel loop walks: some milliseconds at most, and
// sums that fit the second cache.
constexpr int64_t kTilesPerBlock = 256;
// Below this many products a loop is not worth sharing among threads.
constexpr int64_t kParallelProducts = 1 << 18;

// columns x changes x 3
std::vector<float> Interleaved(int64_t columns,
                               std::span<const SumsChange* const> changes) {
  std::vector<float> all;
  all.reserve(columns * changes.size() * 3);
  for (int64_t c = 0; c < columns; ++c) {
    for (const SumsChange* change : changes) {
      for (int64_t d = 0; d < 3; ++d) {
        all.push_back(static_cast<float>(change->values[c * 3 + d]));
      }
    }
  }
  return all;
}

}  // namespace

struct DenseSums::Part {
  Part(DenseSums* of, const SumsChange& change)
      : sums(of),
        copied(of->moved_.Follow(of->weights_, change.columns, true)),
        columns(copied ? of->moved_.copied() : change.columns),
        values(change.values.begin(), change.values.end()) {
    if (!copied) return;
    // Columns that are copied but did not move this time change by 0.
    values.assign(columns.size() * 3, 0.0);
    for (size_t k = 0; k < change.columns.size(); ++k) {
      const auto at = std::ranges::lower_bound(columns, change.columns[k]);
      std::copy_n(&change.values[k * 3], 3,
                  &values[(at - columns.begin()) * 3]);
    }
  }

  // To tiles [first, first + count).
  void Add(int64_t first, int64_t count) const {
    MovedColumns& moved = sums->moved_;
    const WeightTiles& weights = sums->weights_;
    if (copied) moved.Fill(weights, first, count);
    AddTileColumns(copied ? moved.tile(first) : weights.tile(first), count,
                   copied ? std::ssize(columns) : weights.columns(),
                   copied ? nullptr : columns.data(), std::ssize(columns),
                   values.data(), sums->sums_.data() + first * kTileSums);
  }

  DenseSums* sums;
  bool copied;
  std::span<const int32_t> columns;
  std::vector<double> values;
};

DenseSums::DenseSums(const WeightTiles& weights)
    : weights_(weights), sums_(weights.tiles() * kTileSums) {}

bool DenseSums::PrefersAdding(std::span<const int32_t> columns) const {
  // Scattered columns of large weights take four times as long to read.
  const bool forward = weights_.bytes() < MovedColumns::kWorthCopying ||
                       moved_.Expects(weights_, columns);
  return std::ssize(columns) * (forward ? 2 : 4) <= weights_.columns();
}

void DenseSums::Copy(int64_t first, int64_t count, double* out) const {
  for (int64_t i = first; i < first + count; ++i) {
    const double* tile =
        sums_.data() + i / kTilePoints * kTileSums + i % kTilePoints;
    for (int64_t d = 0; d < 3; ++d) *out++ = tile[d * kTilePoints];
  }
}

void DenseSums::Apply(const WeightTiles& weights,
                      std::span<const SumsChange> changes, ThreadPool* pool) {
  std::vector<const SumsChange*> full;
  std::vector<Part> parts;
  for (const SumsChange& change : changes) {
    auto* sums = static_cast<DenseSums*>(change.sums);
    if (change.full) {
      sums->moved_.Follow(weights, change.columns, false);
      full.push_back(&change);
    } else {
      parts.emplace_back(sums, change);
    }
  }
  const std::vector<float> columns = Interleaved(weights.columns(), full);
  const auto sets = std::ssize(full);
  const auto apply_full = [&](int64_t first, int64_t count) {
    if (sets == 0) return;
    std::vector<float> sums(count * sets * kTileSums);
    ApplyTiles(weights.tile(first), count, weights.columns(), sets,
               columns.data(), sums.data());
    for (int64_t s = 0; s < sets; ++s) {
      double* to = static_cast<DenseSums*>(full[s]->sums)->sums_.data() +
                   first * kTileSums;
      for (int64_t t = 0; t < count; ++t) {
        std::copy_n(sums.data() + (t * sets + s) * kTileSums, kTileSums,
                    to + t * kTileSums);
      }
    }
  };
  const int64_t tiles = weights.tiles();
  const int64_t blocks = (tiles + kTilesPerBlock - 1) / kTilesPerBlock;
  const auto block = [&](int64_t b) {
    const int64_t first = b * kTilesPerBlock;
    const int64_t count = std::min(kTilesPerBlock, tiles - first);
    apply_full(first, count);
    for (const Part& part : parts) part.Add(first, count);
  };
  const int64_t products = tiles * kTilePoints * weights.columns();
  if (pool != nullptr && blocks > 1 && products > kParallelProducts) {
    pool->ParallelFor(blocks, nullptr, block);
  } else {
    for (int64_t b = 0; b < blocks; ++b) block(b);
  }
}

}  // namespace deform
