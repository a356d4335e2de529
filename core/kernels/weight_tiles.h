// Weights as the deformation kernels read them: tiles of 16 points, all columns
// of a tile behind each other, so that a tile is one forward walk.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "core/kernels/zeroed_array.h"

namespace deform {

inline constexpr int64_t kTilePoints = 16;

// As a tile holds it: infinity, of the same sign, if float cannot.
inline float RoundedWeight(double weight) {
  return std::abs(weight) <= std::numeric_limits<float>::max()
             ? static_cast<float>(weight)
             : std::copysign(std::numeric_limits<float>::infinity(),
                             static_cast<float>(weight > 0 ? 1 : -1));
}

// `points` x `columns` numbers, 64-byte aligned, zero where not set. The last
// tile is padded with points of zeros.
template <typename Number>
class Tiles {
 public:
  Tiles() = default;
  Tiles(int64_t points, int64_t columns)
      : points_(points),
        columns_(columns),
        data_(TilesOf(points) * columns * kTilePoints) {}

  // Those of somebody else, laid out like ours; see ZeroedArray::Borrow().
  static Tiles Borrow(int64_t points, int64_t columns, const Number* numbers,
                      std::shared_ptr<const void> owner) {
    Tiles tiles;
    tiles.points_ = points;
    tiles.columns_ = columns;
    tiles.data_ = ZeroedArray<Number>::Borrow(
        numbers, TilesOf(points) * columns * kTilePoints, std::move(owner));
    return tiles;
  }

  static int64_t TilesOf(int64_t points) {
    return (points + kTilePoints - 1) / kTilePoints;
  }

  int64_t points() const { return points_; }
  int64_t columns() const { return columns_; }
  int64_t tiles() const { return TilesOf(points_); }
  int64_t bytes() const { return data_.bytes(); }
  static int64_t BytesFor(int64_t points, int64_t columns) {
    return TilesOf(points) * kTilePoints * columns * int64_t{sizeof(Number)};
  }

  // columns x 16 numbers.
  const Number* tile(int64_t t) const { return data_.data() + Offset(t); }
  Number* tile(int64_t t) { return data_.data() + Offset(t); }

  Number at(int64_t point, int64_t column) const {
    return tile(point /
                kTilePoints)[column * kTilePoints + point % kTilePoints];
  }
  // Different points of different tiles may be set from different threads.
  void set(int64_t point, int64_t column, Number value) {
    tile(point / kTilePoints)[column * kTilePoints + point % kTilePoints] =
        value;
  }
  // Sets all numbers of a point to 0.
  void Clear(int64_t point) {
    for (int64_t c = 0; c < columns_; ++c) set(point, c, 0);
  }

 private:
  int64_t Offset(int64_t t) const { return t * columns_ * kTilePoints; }

  int64_t points_ = 0;
  int64_t columns_ = 0;
  ZeroedArray<Number> data_;
};

using WeightTiles = Tiles<float>;

}  // namespace deform
