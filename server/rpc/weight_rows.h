// Weights as messages of GetWeights.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "core/weights/binding.h"
#include "deform/v1/binding.pb.h"

namespace deform::server {

// A range of a binding's points.
struct PointRange {
  int64_t first = 0;
  int64_t count = 0;
};

// The points that `request` asks for. InvalidArgument POINT_OUT_OF_RANGE,
// UNKNOWN_VALUE (precision).
absl::StatusOr<PointRange> WantedPoints(const v1::GetWeightsRequest& request,
                                        const BindingFacts& binding);

// Points whose rows fit one message of 1 MiB; at least one.
int64_t PointsPerMessage(const BindingFacts& binding,
                         v1::WeightPrecision precision);

// The rows of `range` as they are cached, or computed again.
v1::GetWeightsResponse CachedRows(const Binding& binding,
                                  const PointRange& range);
absl::StatusOr<v1::GetWeightsResponse> RecomputedRows(
    const BindingFacts& binding, const PointRange& range);

}  // namespace deform::server
