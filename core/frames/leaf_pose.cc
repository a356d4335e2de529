#include "core/frames/leaf_pose.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>

#include "core/base/aligned_array.h"
#include "core/frames/encoding.h"
#include "core/kernels/apply_mixed.h"
#include "core/kernels/apply_weights.h"

namespace deform {
namespace {

// Points that are placed at a time.
constexpr int64_t kPoints = 4096;

// Places points [first, first + count) with the sums of all slots, as
// Deformer::CopyRelative() does. False if one comes out at no finite place.
bool Place(const AffineMap& map, const LeafBasis& basis, const float* sums,
           const Vec3& origin, int64_t first, int64_t count, float* out) {
  const int dimension = basis.dimension();
  const auto rest = basis.rest();
  bool finite = true;
  for (int64_t i = first; i < first + count; ++i) {
    Vec3 point = rest.row(i).transpose();
    if (const int64_t slot = basis.slots()[i]; slot >= 0) {
      const float* sum =
          sums + slot / kTilePoints * kTileSums + slot % kTilePoints;
      point = map(point) + Vec3(sum[0], sum[kTilePoints], sum[2 * kTilePoints]);
    }
    for (int d = 0; d < dimension; ++d) {
      const auto x = static_cast<float>(point(d) - origin(d));
      finite = finite && std::isfinite(x);
      out[i * dimension + d] = x;
    }
  }
  return finite;
}

}  // namespace

LeafPose LeafPoseOf(const Deformer& deformer) {
  return {.map = deformer.map(), .coefficients = deformer.LeafCoefficients()};
}

absl::Status PlacePoints(const LeafPose& pose, const LeafBasis& basis,
                         const Vec3& origin, ThreadPool* pool,
                         std::span<float> positions) {
  assert(std::ssize(positions) == basis.point_count() * basis.dimension());
  const AlignedArray<float> sums(basis.slot_count() * 3);
  const auto& leaves = basis.leaves();
  ParallelFor(pool, std::ssize(leaves), nullptr, [&](int64_t l) {
    const LeafBasis::Leaf& leaf = leaves[l];
    ApplyMixed(leaf.numbers, leaf.blocks, leaf.columns,
               pose.coefficients.data() + leaf.first_row * 3,
               sums.get() + leaf.first_slot * 3);
  });
  std::atomic<bool> finite = true;
  const int64_t parts = (basis.point_count() + kPoints - 1) / kPoints;
  ParallelFor(pool, parts, nullptr, [&](int64_t part) {
    const int64_t first = part * kPoints;
    const int64_t count = std::min(kPoints, basis.point_count() - first);
    if (!Place(pose.map, basis, sums.get(), origin, first, count,
               positions.data())) {
      finite = false;
    }
  });
  if (finite) return absl::OkStatus();
  return BadFrameData("the frame puts points at no finite place");
}

}  // namespace deform
