// Source: the nearest triangle spreads from node to node in alternating sweeps,
//   as in Danielsson, "Euclidean distance mapping", CGIP 14, 1980. A node takes
//   its distance from the true triangle, so errors occur only where a nearest
//   triangle is nearest to none of the neighbours, and are far below the
//   spacing.
#include "core/mesh/distance_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/mesh/mesh.h"
#include "core/mesh/triangle.h"

namespace deform {

DistanceGrid::DistanceGrid(const Positions& positions, const Faces& faces,
                           double spacing, double padding)
    : spacing_(spacing) {
  const Box box = BoxOf(positions);
  origin_ = box.min.array() - padding;
  for (int axis = 0; axis < 3; ++axis) {
    const double length = box.max[axis] - box.min[axis] + 2 * padding;
    nodes_[axis] = 2 + static_cast<int>(length / spacing);
  }
  const auto corner = [&](int32_t v) -> Vec3 { return positions.row(v); };
  for (const auto& face : faces.rowwise()) {
    sources_.push_back({corner(face[0]), corner(face[1]), corner(face[2])});
  }
  for (int32_t v = 0; faces.rows() == 0 && v < positions.rows(); ++v) {
    sources_.push_back({corner(v), corner(v), corner(v)});
  }
  nearest_.assign(node_count(), -1);
  distance_.assign(node_count(), std::numeric_limits<double>::infinity());
  Seed(faces);
  Sweep();
}

double DistanceGrid::DistanceFrom(int32_t source, const Vec3& point) const {
  const auto& [a, b, c] = sources_[source];
  return (ClosestOnTriangle(point, a, b, c) - point).norm();
}

void DistanceGrid::Offer(const Node& node, int32_t source) {
  const int64_t index = IndexOf(node);
  if (nearest_[index] == source) return;
  const double distance = DistanceFrom(source, PositionOf(node));
  if (distance < distance_[index]) {
    distance_[index] = distance;
    nearest_[index] = source;
  }
}

void DistanceGrid::Seed(const Faces& faces) {
  for (int32_t s = 0; s < static_cast<int32_t>(sources_.size()); ++s) {
    const auto& [a, b, c] = sources_[s];
    const double longest =
        std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    const int steps =
        faces.rows() == 0 ? 1 : 1 + static_cast<int>(longest / spacing_);
    for (int i = 0; i <= steps; ++i) {
      for (int j = 0; i + j <= steps; ++j) {
        const Vec3 sample = a + (b - a) * i / steps + (c - a) * j / steps;
        const Vec3 cell = (sample - origin_) / spacing_;
        for (int corner = 0; corner < 8; ++corner) {
          Node node;
          for (int axis = 0; axis < 3; ++axis) {
            node[axis] =
                std::clamp(static_cast<int>(cell[axis]) + (corner >> axis & 1),
                           0, nodes_[axis] - 1);
          }
          Offer(node, s);
        }
      }
    }
  }
}

void DistanceGrid::Sweep() {
  for (int corner = 0; corner < 8; ++corner) {
    Node step;
    for (int axis = 0; axis < 3; ++axis)
      step[axis] = corner >> axis & 1 ? 1 : -1;
    const auto at = [&](int axis, int i) {
      return step[axis] > 0 ? i : nodes_[axis] - 1 - i;
    };
    for (int k = 0; k < nodes_[2]; ++k) {
      for (int j = 0; j < nodes_[1]; ++j) {
        for (int i = 0; i < nodes_[0]; ++i) {
          const Node node = {at(0, i), at(1, j), at(2, k)};
          for (int axis = 0; axis < 3; ++axis) {
            Node neighbour = node;
            neighbour[axis] -= step[axis];
            if (neighbour[axis] < 0 || neighbour[axis] >= nodes_[axis])
              continue;
            const int32_t source = nearest_[IndexOf(neighbour)];
            if (source >= 0) Offer(node, source);
          }
        }
      }
    }
  }
}

double DistanceGrid::At(const Vec3& point) const {
  Node low;
  Vec3 part;
  for (int axis = 0; axis < 3; ++axis) {
    const double x = std::clamp((point[axis] - origin_[axis]) / spacing_, 0.0,
                                nodes_[axis] - 1.0);
    low[axis] = std::min(static_cast<int>(x), nodes_[axis] - 2);
    part[axis] = x - low[axis];
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1;
    Node node = low;
    for (int axis = 0; axis < 3; ++axis) {
      const int up = corner >> axis & 1;
      node[axis] += up;
      weight *= up == 1 ? part[axis] : 1 - part[axis];
    }
    sum += weight * distance_[IndexOf(node)];
  }
  return sum;
}

}  // namespace deform
