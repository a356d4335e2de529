#include "server/rpc/weight_rows.h"

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {
namespace {

constexpr int64_t kMessageBytes = int64_t{1} << 20;

v1::GetWeightsResponse Header(const BindingFacts& binding,
                              const PointRange& range,
                              v1::WeightPrecision precision) {
  v1::GetWeightsResponse rows;
  rows.set_first_point(range.first);
  rows.set_point_count(range.count);
  rows.set_vertex_count(binding.vertex_count());
  rows.set_normal_count(binding.normal_count());
  rows.set_precision(precision);
  return rows;
}

template <typename Number>
void Append(const Number* numbers, int64_t count, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(numbers), count * sizeof(Number));
}

}  // namespace

absl::StatusOr<PointRange> WantedPoints(const v1::GetWeightsRequest& request,
                                        const BindingFacts& binding) {
  if (!v1::WeightPrecision_IsValid(request.precision())) {
    return InvalidInput(
        "UNKNOWN_VALUE", "precision",
        absl::StrCat("precision ", request.precision(), " is not known"));
  }
  const uint64_t points = binding.point_count();
  const uint64_t first = request.first_point();
  if (first >= points) {
    return InvalidInput("POINT_OUT_OF_RANGE", "first_point",
                        absl::StrCat("first_point is ", first,
                                     "; the binding has ", points, " points"));
  }
  if (request.point_count() > points - first) {
    return InvalidInput(
        "POINT_OUT_OF_RANGE", "point_count",
        absl::StrCat("point_count is ", request.point_count(), "; after point ",
                     first, " the binding has ", points - first));
  }
  const uint64_t count =
      request.point_count() > 0 ? request.point_count() : points - first;
  return PointRange{static_cast<int64_t>(first), static_cast<int64_t>(count)};
}

int64_t PointsPerMessage(const BindingFacts& binding,
                         v1::WeightPrecision precision) {
  const int64_t number = precision == v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64
                             ? sizeof(double)
                             : sizeof(float);
  return std::max<int64_t>(1,
                           kMessageBytes / (binding.column_count() * number));
}

v1::GetWeightsResponse CachedRows(const Binding& binding,
                                  const PointRange& range) {
  auto rows = Header(binding, range, v1::WEIGHT_PRECISION_CACHED_FLOAT32);
  std::vector<float> weights(range.count * binding.column_count());
  binding.CopyWeights(range.first, range.count, weights.data());
  Append(weights.data(), std::ssize(weights), rows.mutable_data());
  return rows;
}

absl::StatusOr<v1::GetWeightsResponse> RecomputedRows(
    const BindingFacts& binding, const PointRange& range) {
  DEFORM_ASSIGN_OR_RETURN(const WeightBlock block,
                          RecomputeWeights(binding, range.first, range.count));
  auto rows = Header(binding, range, v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64);
  for (int64_t i = 0; i < range.count; ++i) {
    Append(block.vertex.row(i).data(), block.vertex.cols(),
           rows.mutable_data());
    Append(block.normal.row(i).data(), block.normal.cols(),
           rows.mutable_data());
  }
  return rows;
}

}  // namespace deform::server
