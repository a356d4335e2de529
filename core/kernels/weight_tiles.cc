#include "core/kernels/weight_tiles.h"

#include <cstdlib>
#include <memory>
#include <new>

namespace deform {
namespace {

constexpr size_t kAlignment = 64;

}  // namespace

WeightTiles::WeightTiles(int64_t points, int64_t columns)
    : points_(points), columns_(columns) {
  if (bytes() == 0) return;
  // calloc() leaves the zeroing of large blocks to the system, page by page as
  // threads first write them: gigabytes of weights cost nothing here.
  const size_t size = static_cast<size_t>(bytes());
  size_t space = size + kAlignment;
  void* block = std::calloc(space, 1);
  if (block == nullptr) throw std::bad_alloc();
  void* aligned = block;
  std::align(kAlignment, size, aligned, space);
  data_ =
      std::unique_ptr<float[], Free>(static_cast<float*>(aligned), Free(block));
}

}  // namespace deform
