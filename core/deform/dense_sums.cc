#include "core/deform/dense_sums.h"

#include <algorithm>

#include "absl/functional/function_ref.h"
#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

// Tiles that one body of a parallel loop walks: some milliseconds at most, and
// sums that fit the second cache.
constexpr int64_t kTilesPerBlock = 256;
// Below this many products a loop is not worth sharing among threads.
constexpr int64_t kParallelProducts = 1 << 18;

// Calls body(first, count) for blocks of all tiles.
void ForEachBlock(const WeightTiles& weights, ThreadPool* pool,
                  absl::FunctionRef<void(int64_t, int64_t)> body) {
  const int64_t tiles = weights.tiles();
  const int64_t blocks = (tiles + kTilesPerBlock - 1) / kTilesPerBlock;
  const int64_t products = tiles * kTilePoints * weights.columns();
  const bool share = blocks > 1 && products > kParallelProducts;
  ParallelFor(share ? pool : nullptr, blocks, nullptr, [&](int64_t b) {
    const int64_t first = b * kTilesPerBlock;
    body(first, std::min(kTilesPerBlock, tiles - first));
  });
}

template <typename Number>
void CopyTiles(const Number* tiles, int64_t first, int64_t count, double* out) {
  for (int64_t i = first; i < first + count; ++i) {
    const Number* tile = tiles + i / kTilePoints * kTileSums + i % kTilePoints;
    for (int64_t d = 0; d < 3; ++d) *out++ = tile[d * kTilePoints];
  }
}

}  // namespace

// Of several sums together, in one pass over the weights.
class DenseSums::FullStep {
 public:
  FullStep(const WeightTiles& weights,
           const std::vector<const SumsChange*>& changes)
      : weights_(weights) {
    for (const SumsChange* change : changes) {
      auto* sums = static_cast<DenseSums*>(change->sums);
      sums->DropDrag();
      sums->moved_.Follow(weights, change->columns, false);
      sums_.push_back(sums);
    }
    for (int64_t c = 0; c < weights.columns(); ++c) {
      for (const SumsChange* change : changes) {
        for (int64_t d = 0; d < 3; ++d) {
          column_.push_back(static_cast<float>(change->values[c * 3 + d]));
        }
      }
    }
  }

  // To tiles [first, first + count).
  void Apply(int64_t first, int64_t count) const {
    const auto sets = std::ssize(sums_);
    if (sets == 0) return;
    std::vector<float> sums(count * sets * kTileSums);
    ApplyTiles(weights_.tile(first), count, weights_.columns(), sets,
               column_.data(), sums.data());
    for (int64_t s = 0; s < sets; ++s) {
      for (int64_t t = 0; t < count; ++t) {
        std::copy_n(sums.data() + (t * sets + s) * kTileSums, kTileSums,
                    sums_[s]->sums_.data() + (first + t) * kTileSums);
      }
    }
  }

 private:
  const WeightTiles& weights_;
  std::vector<DenseSums*> sums_;
  std::vector<float> column_;  // columns x changes x 3
};

class DenseSums::PartialStep {
 public:
  PartialStep(const SumsChange& change, ThreadPool* pool)
      : sums_(*static_cast<DenseSums*>(change.sums)), change_(change) {
    MovedColumns& moved = sums_.moved_;
    if (!moved.Has(change.columns)) sums_.Settle(pool);
    if (!moved.Follow(sums_.weights_, change.columns, true)) return;
    const std::span<const int32_t> copied = moved.copied();
    if (!sums_.dragging()) {
      begins_ = true;
      sums_.shift_.assign(copied.size() * 3, 0.0);
      sums_.base_ = ZeroedArray<float>(sums_.sums_.size());
      sums_.now_ = ZeroedArray<float>(sums_.sums_.size());
    }
    for (size_t k = 0; k < change.columns.size(); ++k) {
      const auto at = std::ranges::lower_bound(copied, change.columns[k]);
      for (int64_t d = 0; d < 3; ++d) {
        sums_.shift_[(at - copied.begin()) * 3 + d] += change.values[k * 3 + d];
      }
    }
    column_.assign(sums_.shift_.begin(), sums_.shift_.end());
  }

  // To tiles [first, first + count).
  void Apply(int64_t first, int64_t count) const {
    const WeightTiles& weights = sums_.weights_;
    const int64_t begin = first * kTileSums;
    double* kept = sums_.sums_.data() + begin;
    if (!sums_.dragging()) {
      AddTileColumns(weights.tile(first), count, weights.columns(),
                     change_.columns.data(), std::ssize(change_.columns),
                     change_.values.data(), kept);
      return;
    }
    float* base = sums_.base_.data() + begin;
    if (begins_) std::copy_n(kept, count * kTileSums, base);
    sums_.moved_.Fill(weights, first, count);
    ApplyTilesBeside(base, sums_.moved_.tile(first), count,
                     std::ssize(sums_.moved_.copied()), column_.data(),
                     sums_.now_.data() + begin);
  }

 private:
  DenseSums& sums_;
  const SumsChange& change_;
  bool begins_ = false;  // A drag.
  std::vector<float> column_;
};

DenseSums::DenseSums(const WeightTiles& weights, Allowance& copies)
    : weights_(weights), sums_(weights.tiles() * kTileSums), moved_(copies) {}

bool DenseSums::PrefersAdding(std::span<const int32_t> columns) const {
  // Scattered columns of large weights take four times as long to read.
  const bool forward = weights_.bytes() < MovedColumns::kWorthCopying ||
                       moved_.Expects(weights_, columns);
  return std::ssize(columns) * (forward ? 2 : 4) <= weights_.columns();
}

void DenseSums::Copy(int64_t first, int64_t count, double* out) const {
  if (dragging()) {
    CopyTiles(now_.data(), first, count, out);
  } else {
    CopyTiles(sums_.data(), first, count, out);
  }
}

void DenseSums::Settle(ThreadPool* pool) {
  if (!dragging()) return;
  const auto copied = std::ssize(moved_.copied());
  ForEachBlock(weights_, pool, [&](int64_t first, int64_t count) {
    AddTileColumns(moved_.tile(first), count, copied, nullptr, copied,
                   shift_.data(), sums_.data() + first * kTileSums);
  });
  DropDrag();
}

void DenseSums::DropDrag() {
  shift_.clear();
  base_ = {};
  now_ = {};
}

void DenseSums::Apply(const WeightTiles& weights,
                      std::span<const SumsChange> changes, ThreadPool* pool) {
  std::vector<const SumsChange*> of_all;
  std::vector<PartialStep> partial;
  partial.reserve(changes.size());
  for (const SumsChange& change : changes) {
    if (change.full) {
      of_all.push_back(&change);
    } else {
      partial.emplace_back(change, pool);
    }
  }
  const FullStep full(weights, of_all);
  ForEachBlock(weights, pool, [&](int64_t first, int64_t count) {
    full.Apply(first, count);
    for (const PartialStep& step : partial) step.Apply(first, count);
  });
}

}  // namespace deform
