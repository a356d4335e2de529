// Distances from a model, at the nodes of a lattice around it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/types.h"

namespace deform {

// Unsigned distances from the triangles, and from points where there are none.
// Immutable.
class DistanceGrid {
 public:
  using Node = std::array<int, 3>;

  // The lattice has the given spacing and reaches `padding` beyond the bounding
  // box on each side. `faces` is F x 3; without faces the positions count.
  // O(nodes + F + area / spacing^2).
  DistanceGrid(const Positions& positions, const Faces& faces, double spacing,
               double padding);

  // Nodes along each axis, two at least.
  const Node& nodes() const { return nodes_; }
  int64_t node_count() const {
    return int64_t{nodes_[0]} * nodes_[1] * nodes_[2];
  }
  int64_t IndexOf(const Node& node) const {
    return (int64_t{node[2]} * nodes_[1] + node[1]) * nodes_[0] + node[0];
  }
  Vec3 PositionOf(const Node& node) const {
    return origin_ + spacing_ * Vec3(node[0], node[1], node[2]);
  }
  double spacing() const { return spacing_; }

  // Of a node: the distance from the triangle that is closest, or rarely one
  // nearly as close.
  double distance(int64_t index) const { return distance_[index]; }
  // Interpolated between the nodes; points beyond the lattice get the value of
  // its border.
  double At(const Vec3& point) const;

 private:
  void Offer(const Node& node, int32_t source);
  // Offers each source to the nodes of the cells that it touches.
  void Seed(const Faces& faces);
  // Offers each node the sources of its neighbours, from all eight corners.
  void Sweep();
  double DistanceFrom(int32_t source, const Vec3& point) const;

  double spacing_;
  Vec3 origin_;
  Node nodes_;
  // Corners of the triangles, or one point thrice.
  std::vector<std::array<Vec3, 3>> sources_;
  std::vector<int32_t> nearest_;  // Source of each node, -1 for none yet.
  std::vector<double> distance_;
};

}  // namespace deform
