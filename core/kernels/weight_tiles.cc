#include "core/kernels/weight_tiles.h"

#include <cstring>
#include <new>

namespace deform {

WeightTiles::WeightTiles(int64_t points, int64_t columns)
    : points_(points), columns_(columns) {
  if (bytes() == 0) return;
  auto* data =
      static_cast<float*>(std::aligned_alloc(64, static_cast<size_t>(bytes())));
  if (data == nullptr) throw std::bad_alloc();
  std::memset(data, 0, static_cast<size_t>(bytes()));
  data_.reset(data);
}

}  // namespace deform
