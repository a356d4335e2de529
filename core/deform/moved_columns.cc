#include "core/deform/moved_columns.h"

#include <algorithm>
#include <iterator>

namespace deform {
namespace {

// Whether a copy of `have` is good for a step of `wanted`: it is read as a
// whole, so most of it should be of use.
bool Serves(std::span<const int32_t> have, std::span<const int32_t> wanted) {
  return 2 * wanted.size() >= have.size() &&
         std::ranges::includes(have, wanted);
}

// Of a copy of so many columns, with the sums beside it.
int64_t BytesWith(const WeightTiles& weights, int64_t columns) {
  return WeightTiles::BytesFor(weights.points(), columns + 6);
}

}  // namespace

bool MovedColumns::Has(std::span<const int32_t> columns) const {
  return !columns.empty() && Serves(copied_, columns);
}

bool MovedColumns::Expects(const WeightTiles& weights,
                           std::span<const int32_t> columns) const {
  if (Has(columns)) return true;
  if (columns.empty() || weights.bytes() < kWorthCopying) return false;
  const int64_t recent = std::ssize(Recent(columns));
  return recent > 0 &&
         allowance_.used() - taken_ + BytesWith(weights, recent) <=
             allowance_.limit();
}

bool MovedColumns::Follow(const WeightTiles& weights,
                          std::span<const int32_t> columns, bool partial) {
  fresh_ = false;
  if (columns.empty()) return false;
  if (!Has(columns)) {
    Drop();
    std::vector<int32_t> recent = Recent(columns);
    const int64_t bytes = BytesWith(weights, std::ssize(recent));
    if (partial && !recent.empty() && weights.bytes() >= kWorthCopying &&
        allowance_.Take(bytes)) {
      taken_ = bytes;
      copy_ = WeightTiles(weights.points(), std::ssize(recent));
      copied_ = std::move(recent);
      fresh_ = true;
    }
  }
  before_last_ = std::move(last_);
  last_.assign(columns.begin(), columns.end());
  return partial && !copied_.empty();
}

void MovedColumns::Fill(const WeightTiles& weights, int64_t first,
                        int64_t count) {
  if (!fresh_) return;
  for (int64_t t = first; t < first + count; ++t) {
    float* to = copy_.tile(t);
    for (const int32_t c : copied_) {
      to = std::copy_n(weights.tile(t) + c * kTilePoints, kTilePoints, to);
    }
  }
}

std::vector<int32_t> MovedColumns::Recent(
    std::span<const int32_t> columns) const {
  if (Serves(last_, columns)) return last_;
  std::vector<int32_t> both;
  std::ranges::set_union(last_, before_last_, std::back_inserter(both));
  if (!Serves(both, columns)) both.clear();
  return both;
}

void MovedColumns::Drop() {
  allowance_.Give(taken_);
  taken_ = 0;
  copy_ = {};
  copied_.clear();
}

}  // namespace deform
