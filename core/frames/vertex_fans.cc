#include "core/frames/vertex_fans.h"

#include <algorithm>
#include <cassert>
#include <numeric>

#include "core/frames/normals.h"

namespace deform {
namespace {

constexpr int64_t kBlock = 4096;  // Vertices that one thread does in a row.

}  // namespace

VertexFans::VertexFans(const Faces& faces, int64_t points)
    : corners_(3 * faces.rows()), begin_(points + 1) {
  for (int64_t i = 0; i < faces.size(); ++i) ++begin_[faces.data()[i] + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<int64_t> end(begin_.begin(), begin_.end() - 1);
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      corners_[end[faces(f, k)]++] = {faces(f, (k + 1) % 3),
                                      faces(f, (k + 2) % 3)};
    }
  }
}

void VertexFans::EncodeNormals(std::span<const float> positions,
                               std::span<uint8_t> bytes,
                               ThreadPool* pool) const {
  assert(static_cast<int64_t>(positions.size()) == 3 * points());
  assert(static_cast<int64_t>(bytes.size()) == 2 * points());
  // Written out: Eigen's cross products take longer.
  const auto encode = [&](int64_t block) {
    const int64_t end = std::min(points(), (block + 1) * kBlock);
    for (int64_t v = block * kBlock; v < end; ++v) {
      const double x = positions[3 * v], y = positions[3 * v + 1],
                   z = positions[3 * v + 2];
      Vec3 sum = Vec3::Zero();  // Of normals, twice the area long.
      for (int64_t c = begin_[v]; c < begin_[v + 1]; ++c) {
        const float* const next = &positions[3 * int64_t{corners_[c].next}];
        const float* const last = &positions[3 * int64_t{corners_[c].last}];
        const double ax = next[0] - x, ay = next[1] - y, az = next[2] - z;
        const double bx = last[0] - x, by = last[1] - y, bz = last[2] - z;
        sum[0] += ay * bz - az * by;
        sum[1] += az * bx - ax * bz;
        sum[2] += ax * by - ay * bx;
      }
      EncodeNormal(sum, &bytes[kNormalBytes * v]);
    }
  };
  ParallelFor(pool, (points() + kBlock - 1) / kBlock, nullptr, encode);
}

}  // namespace deform
