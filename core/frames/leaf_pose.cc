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

// Points that are placed at a time, and that a thread places in a row.
constexpr int64_t kPoints = 256;
constexpr int64_t kPart = 16 * kPoints;

// Places points [first, first + count), at most kPoints, with the sums of all
// slots, as Deformer::CopyRelative() does. False if one comes out at no finite
// place.
bool Place(const PointMap& map, const LeafBasis& basis, const float* sums,
           int64_t first, int64_t count, float* out) {
  double displacements[kPoints * 3];
  float points[kPoints * 3];
  const auto rest = basis.rest();
  for (int64_t i = 0; i < count; ++i) {
    const int64_t slot = std::max(0, basis.slots()[first + i]);
    const float* const sum =
        sums + slot / kTilePoints * kTileSums + slot % kTilePoints;
    for (int d = 0; d < 3; ++d) displacements[3 * i + d] = sum[d * kTilePoints];
  }
  MapPoints(map, rest.row(first).data(), displacements, count, points);
  const int dimension = basis.dimension();
  bool finite = true;
  for (int64_t i = 0; i < count; ++i) {
    const bool fixed = basis.slots()[first + i] < 0;
    for (int d = 0; d < dimension; ++d) {
      const float x =
          fixed ? static_cast<float>(rest(first + i, d) - map.origin[d])
                : points[3 * i + d];
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
  // Of one tile at least: points without slot read it, and do not use it.
  const AlignedArray<float> sums(std::max(kTileSums, basis.slot_count() * 3));
  const auto& leaves = basis.leaves();
  ParallelFor(pool, std::ssize(leaves), nullptr, [&](int64_t l) {
    const LeafBasis::Leaf& leaf = leaves[l];
    ApplyMixed(leaf.numbers, leaf.blocks, leaf.columns,
               pose.coefficients.data() + leaf.first_row * 3,
               sums.get() + leaf.first_slot * 3);
  });
  std::atomic<bool> finite = true;
  const PointMap map = PointMapOf(pose.map, origin);
  const int64_t parts = (basis.point_count() + kPart - 1) / kPart;
  ParallelFor(pool, parts, nullptr, [&](int64_t part) {
    const int64_t end = std::min((part + 1) * kPart, basis.point_count());
    for (int64_t first = part * kPart; first < end; first += kPoints) {
      if (!Place(map, basis, sums.get(), first, std::min(kPoints, end - first),
                 positions.data() + first * basis.dimension())) {
        finite = false;
      }
    }
  });
  if (finite) return absl::OkStatus();
  return BadFrameData("the frame puts points at no finite place");
}

}  // namespace deform
