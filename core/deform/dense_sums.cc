#include "core/deform/dense_sums.h"

#include <algorithm>

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

DenseSums::DenseSums(const WeightTiles& weights)
    : sums_(weights.tiles() * kTileSums, 0.0) {}

void DenseSums::Copy(int64_t first, int64_t count, double* out) const {
  for (int64_t i = first; i < first + count; ++i) {
    const double* tile =
        sums_.data() + i / kTilePoints * kTileSums + i % kTilePoints;
    for (int64_t d = 0; d < 3; ++d) *out++ = tile[d * kTilePoints];
  }
}

void DenseSums::Apply(const WeightTiles& weights,
                      std::span<const SumsChange> changes, ThreadPool* pool) {
  std::vector<const SumsChange*> full, partial;
  for (const SumsChange& change : changes) {
    (change.full ? full : partial).push_back(&change);
  }
  const auto sums_of = [](const SumsChange* change, int64_t tile) {
    return static_cast<DenseSums*>(change->sums)->sums_.data() +
           tile * kTileSums;
  };
  const std::vector<float> columns = Interleaved(weights.columns(), full);
  const auto sets = std::ssize(full);
  const auto apply_full = [&](int64_t first, int64_t count) {
    if (sets == 0) return;
    std::vector<float> sums(count * sets * kTileSums);
    ApplyTiles(weights.tile(first), count, weights.columns(), sets,
               columns.data(), sums.data());
    for (int64_t s = 0; s < sets; ++s) {
      for (int64_t t = 0; t < count; ++t) {
        std::copy_n(sums.data() + (t * sets + s) * kTileSums, kTileSums,
                    sums_of(full[s], first + t));
      }
    }
  };
  const auto apply_partial = [&](int64_t first, int64_t count) {
    for (const SumsChange* change : partial) {
      AddTileColumns(weights.tile(first), count, weights.columns(),
                     change->columns.data(), std::ssize(change->columns),
                     change->values.data(), sums_of(change, first));
    }
  };
  const int64_t tiles = weights.tiles();
  const int64_t blocks = (tiles + kTilesPerBlock - 1) / kTilesPerBlock;
  const auto block = [&](int64_t b) {
    const int64_t first = b * kTilesPerBlock;
    const int64_t count = std::min(kTilesPerBlock, tiles - first);
    apply_full(first, count);
    apply_partial(first, count);
  };
  const int64_t products = tiles * kTilePoints * weights.columns();
  if (pool != nullptr && blocks > 1 && products > kParallelProducts) {
    pool->ParallelFor(blocks, nullptr, block);
  } else {
    for (int64_t b = 0; b < blocks; ++b) block(b);
  }
}

}  // namespace deform
