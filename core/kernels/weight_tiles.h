// Weights as the deformation kernels read them: tiles of 16 points, all columns
// of a tile behind each other, so that a tile is one forward walk.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <span>

namespace deform {

inline constexpr int64_t kTilePoints = 16;

// As a tile holds it: infinity, of the same sign, if float cannot.
inline float RoundedWeight(double weight) {
  return std::abs(weight) <= std::numeric_limits<float>::max()
             ? static_cast<float>(weight)
             : std::copysign(std::numeric_limits<float>::infinity(),
                             static_cast<float>(weight > 0 ? 1 : -1));
}

// `points` x `columns` float weights, 64-byte aligned, zero where not set. The
// last tile is padded with points of weight 0.
class WeightTiles {
 public:
  WeightTiles() = default;
  WeightTiles(int64_t points, int64_t columns);

  int64_t points() const { return points_; }
  int64_t columns() const { return columns_; }
  int64_t tiles() const { return (points_ + kTilePoints - 1) / kTilePoints; }
  int64_t bytes() const { return BytesFor(points_, columns_); }
  static int64_t BytesFor(int64_t points, int64_t columns) {
    return (points + kTilePoints - 1) / kTilePoints * kTilePoints * columns *
           int64_t{sizeof(float)};
  }

  // columns x 16 floats.
  const float* tile(int64_t t) const { return data_.get() + Offset(t); }
  float* tile(int64_t t) { return data_.get() + Offset(t); }

  float at(int64_t point, int64_t column) const {
    return tile(point /
                kTilePoints)[column * kTilePoints + point % kTilePoints];
  }
  // Different points of different tiles may be set from different threads.
  void set(int64_t point, int64_t column, float value) {
    tile(point / kTilePoints)[column * kTilePoints + point % kTilePoints] =
        value;
  }
  // Sets all weights of a point to 0.
  void Clear(int64_t point) {
    for (int64_t c = 0; c < columns_; ++c) set(point, c, 0);
  }

 private:
  // Of the block in which the tiles lie aligned.
  struct Free {
    Free() : block(nullptr) {}
    explicit Free(void* b) : block(b) {}
    void operator()(float* /*data*/) const { std::free(block); }
    void* block;
  };
  int64_t Offset(int64_t t) const { return t * columns_ * kTilePoints; }

  int64_t points_ = 0;
  int64_t columns_ = 0;
  std::unique_ptr<float[], Free> data_;
};

}  // namespace deform
