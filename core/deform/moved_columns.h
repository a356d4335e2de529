// Copies of the weight columns that keep moving.
//
// While a drag lasts, the same few columns change at every step. Scattered over
// the tiles, they come from memory four times slower than columns that lie side
// by side. So when columns move again that moved just before, a session copies
// them once and reads the copy from then on.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/allowance.h"
#include "core/kernels/weight_tiles.h"

namespace deform {

// Of one session. Not thread-safe, but for Fill() of different tiles. Columns
// are named by their sorted indices.
class MovedColumns {
 public:
  // Weights of fewer bytes stay in the caches, where no order is slow.
  static constexpr int64_t kWorthCopying = int64_t{4} << 20;

  // Copies, and the sums beside them (6 floats a point), are taken from
  // `allowance`, borrowed; who comes too late reads the weights.
  explicit MovedColumns(Allowance& allowance) : allowance_(allowance) {}
  ~MovedColumns() { Drop(); }
  MovedColumns(const MovedColumns&) = delete;
  MovedColumns& operator=(const MovedColumns&) = delete;

  // Whether the copy is good for a step of these columns.
  bool Has(std::span<const int32_t> columns) const;
  // Whether a step of these columns would find them copied, or copy them.
  bool Expects(const WeightTiles& weights,
               std::span<const int32_t> columns) const;

  // Tells what columns a step changes. If it reads weights for them alone
  // (`partial`), says whether from a copy: if so, Fill() all tiles, then apply
  // all of copied() from tile(). Without Has() the copy there was is dropped.
  bool Follow(const WeightTiles& weights, std::span<const int32_t> columns,
              bool partial);

  // Copies tiles [first, first + count) unless an earlier step did.
  void Fill(const WeightTiles& weights, int64_t first, int64_t count);

  std::span<const int32_t> copied() const { return copied_; }
  const float* tile(int64_t t) const { return copy_.tile(t); }
  int64_t bytes() const { return copy_.bytes(); }

 private:
  // What to copy for these columns: those of the last step or, if two
  // participants take turns, of the last two. Empty if they did not move then.
  std::vector<int32_t> Recent(std::span<const int32_t> columns) const;
  void Drop();

  Allowance& allowance_;
  std::vector<int32_t> last_, before_last_;  // Of the last two steps.
  std::vector<int32_t> copied_;
  WeightTiles copy_;
  int64_t taken_ = 0;   // From the allowance.
  bool fresh_ = false;  // Allocated in this step: to be filled.
};

}  // namespace deform
