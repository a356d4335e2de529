#include "core/weights/point_clusters.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace deform {
namespace {

int LongestSide(const Positions& points, std::span<const int32_t> some) {
  Vec3 min = points.row(some.front()).transpose(), max = min;
  for (const int32_t i : some) {
    min = min.cwiseMin(points.row(i).transpose());
    max = max.cwiseMax(points.row(i).transpose());
  }
  int axis = 0;
  (max - min).maxCoeff(&axis);
  return axis;
}

void Cut(const Positions& points, int64_t parts, int64_t unit, Block range,
         std::span<int32_t> order, std::vector<Block>& clusters) {
  const int64_t units = (range.count + unit - 1) / unit;
  parts = std::min(parts, units);
  if (parts <= 1) {
    clusters.push_back(range);
    return;
  }
  const int64_t left_parts = parts / 2;
  const int64_t left = units * left_parts / parts * unit;
  const auto some = order.subspan(range.first, range.count);
  const int axis = LongestSide(points, some);
  std::nth_element(
      some.begin(), some.begin() + left, some.end(), [&](int32_t a, int32_t b) {
        return std::pair(points(a, axis), a) < std::pair(points(b, axis), b);
      });
  Cut(points, left_parts, unit, {range.first, left}, order, clusters);
  Cut(points, parts - left_parts, unit,
      {range.first + left, range.count - left}, order, clusters);
}

}  // namespace

std::vector<Block> CutIntoClusters(const Positions& points, int64_t parts,
                                   int64_t unit, Block range,
                                   std::span<int32_t> order) {
  std::vector<Block> clusters;
  if (range.count > 0) Cut(points, parts, unit, range, order, clusters);
  return clusters;
}

}  // namespace deform
