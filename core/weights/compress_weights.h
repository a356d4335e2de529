// Making compressed weights, cluster by cluster.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/cancellation.h"
#include "core/base/thread_pool.h"
#include "core/mesh/types.h"
#include "core/weights/compressed_weights.h"

namespace deform {

// Weights to be compressed.
struct WeightSource {
  const Positions* points = nullptr;         // N x 3.
  std::span<const int64_t> without_weights;  // Sorted.
  // R_c, one a column: how far it may move relative to others; the bound counts
  // displacements in these.
  std::vector<double> scale;
  // Writes the weights of some points, neighbours in space, into `rows`, as
  // many x C. Called from several threads at once, for about 10^4 points at a
  // time, so that all weights need never exist at once.
  std::function<void(std::span<const int32_t> points, WeightTiles& rows)> rows;
};

struct CompressControl {
  ThreadPool* pool = nullptr;  // These may be null.
  const Cancellation* cancellation = nullptr;
  std::atomic<int64_t>* points_done = nullptr;  // Only rises.
  int64_t max_bytes = 0;  // Give up when they take more; 0: no limit.
};

// What is needed beside the weights to compress them, at most, with so many
// threads at work.
int64_t CompressionBytes(int64_t points, int64_t columns, int threads);

// Weights that reproduce `source` so that for every pose
//
//   |error of a point| <= bound() x max over c of |x_c| / R_c
//
// with bound() <= tolerance > 0, unless half of that is not enough for the
// rounding of float sums: about 1e-6 where rows sum to about 1. The same
// whatever the number of threads. Cancelled; ResourceExhausted NOT_SMALLER
// beyond `max_bytes`.
//
// Clusters of about 10^4 points get a basis by pivoted Gram-Schmidt over some
// of their rows, extended by the rows it misses most; branches and leaves turn
// their coefficients to principal axes and cut them. Each leaf is proved after
// quantisation: the largest sum over c of |weight - approximation| R_c over its
// rows is within the tolerance, or it is made again, finer.
absl::StatusOr<CompressedWeights> CompressWeights(
    const WeightSource& source, double tolerance,
    const CompressControl& control);

}  // namespace deform
