// Marching tetrahedra: each lattice cell is six tetrahedra around a diagonal,
// which fit across cells, so the surface of a function that changes sign along
// their edges is closed and manifold without any table of cases.
#include "core/mesh/offset_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <vector>

#include <Eigen/Geometry>

namespace deform {
namespace {

using Node = DistanceGrid::Node;

Node Plus(const Node& a, int bits, int sign = 1) {
  return {a[0] + sign * (bits & 1), a[1] + sign * (bits >> 1 & 1),
          a[2] + sign * (bits >> 2 & 1)};
}

// Nodes farther than `distance` that can be reached from the border along edges
// of the tetrahedra.
std::vector<bool> FindOutside(const DistanceGrid& grid, double distance) {
  std::vector<bool> outside(grid.node_count(), false);
  std::vector<Node> open;
  const auto visit = [&](const Node& node) {
    for (int axis = 0; axis < 3; ++axis) {
      if (node[axis] < 0 || node[axis] >= grid.nodes()[axis]) return;
    }
    const int64_t index = grid.IndexOf(node);
    if (outside[index] || grid.distance(index) <= distance) return;
    outside[index] = true;
    open.push_back(node);
  };
  visit({0, 0, 0});
  while (!open.empty()) {
    const Node node = open.back();
    open.pop_back();
    for (int bits = 1; bits < 8; ++bits) {
      visit(Plus(node, bits));
      visit(Plus(node, bits, -1));
    }
  }
  return outside;
}

class Marcher {
 public:
  Marcher(const DistanceGrid& grid, double distance)
      : grid_(grid),
        distance_(distance),
        outside_(FindOutside(grid, distance)) {}

  TriangleSurface Run() && {
    const Node& nodes = grid_.nodes();
    for (int k = 0; k + 1 < nodes[2]; ++k) {
      for (int j = 0; j + 1 < nodes[1]; ++j) {
        for (int i = 0; i + 1 < nodes[0]; ++i) AddCell({i, j, k});
      }
    }
    return {
        Eigen::Map<const Positions>(
            points_.data(), static_cast<Eigen::Index>(points_.size() / 3), 3),
        Eigen::Map<const Faces>(corners_.data(),
                                static_cast<Eigen::Index>(corners_.size() / 3),
                                3)};
  }

 private:
  // Corners of a cell by the bits of their number; a tetrahedron steps along
  // one axis after the other from corner 0 to corner 7.
  using Tetrahedron = std::array<int, 4>;

  bool Outside(const Node& node) const { return outside_[grid_.IndexOf(node)]; }

  void AddCell(const Node& cell) {
    int count = 0;
    for (int bits = 0; bits < 8; ++bits) count += Outside(Plus(cell, bits));
    if (count == 0 || count == 8) return;
    constexpr Tetrahedron kTetrahedra[] = {{0, 1, 3, 7}, {0, 1, 5, 7},
                                           {0, 2, 3, 7}, {0, 2, 6, 7},
                                           {0, 4, 5, 7}, {0, 4, 6, 7}};
    for (const Tetrahedron& t : kTetrahedra) AddTetrahedron(cell, t);
  }

  void AddTetrahedron(const Node& cell, const Tetrahedron& tetrahedron) {
    std::vector<int>& in = in_;
    std::vector<int>& out = out_;
    in.clear();
    out.clear();
    for (const int bits : tetrahedron) {
      (Outside(Plus(cell, bits)) ? out : in).push_back(bits);
    }
    if (in.empty() || out.empty()) return;
    const Vec3 outward = grid_.PositionOf(Plus(cell, out[0])) -
                         grid_.PositionOf(Plus(cell, in[0]));
    if (in.size() == 2) {
      const int32_t quad[] = {
          Vertex(cell, in[0], out[0]), Vertex(cell, in[0], out[1]),
          Vertex(cell, in[1], out[1]), Vertex(cell, in[1], out[0])};
      AddTriangle({quad[0], quad[1], quad[2]}, outward);
      AddTriangle({quad[0], quad[2], quad[3]}, outward);
    } else if (in.size() == 1) {
      AddTriangle({Vertex(cell, in[0], out[0]), Vertex(cell, in[0], out[1]),
                   Vertex(cell, in[0], out[2])},
                  outward);
    } else {
      AddTriangle({Vertex(cell, in[0], out[0]), Vertex(cell, in[1], out[0]),
                   Vertex(cell, in[2], out[0])},
                  outward);
    }
  }

  void AddTriangle(std::array<int32_t, 3> triangle, const Vec3& outward) {
    const auto point = [&](int k) {
      return Eigen::Map<const Vec3>(&points_[3 * triangle[k]]);
    };
    const Vec3 normal = (point(1) - point(0)).cross(point(2) - point(0));
    if (normal.dot(outward) < 0) std::swap(triangle[1], triangle[2]);
    corners_.insert(corners_.end(), triangle.begin(), triangle.end());
  }

  // Negative inside.
  double Value(const Node& node) const {
    const double beyond = grid_.distance(grid_.IndexOf(node)) - distance_;
    return Outside(node) ? beyond : -std::abs(beyond);
  }

  // The surface's vertex on the edge from corner `in` to corner `out`. It keeps
  // off the nodes, so that no triangle degenerates.
  int32_t Vertex(const Node& cell, int in, int out) {
    const Node low = Plus(cell, in & out);
    const int64_t key = 8 * grid_.IndexOf(low) + (in ^ out);
    const auto [entry, is_new] =
        vertices_.try_emplace(key, static_cast<int32_t>(points_.size() / 3));
    if (is_new) {
      const Node a = Plus(cell, in);
      const Node b = Plus(cell, out);
      const double from = Value(a);
      const double t = std::clamp(from / (from - Value(b)), 0.1, 0.9);
      const Vec3 point =
          (1 - t) * grid_.PositionOf(a) + t * grid_.PositionOf(b);
      points_.insert(points_.end(), point.begin(), point.end());
    }
    return entry->second;
  }

  const DistanceGrid& grid_;
  double distance_;
  std::vector<bool> outside_;
  std::vector<int> in_;
  std::vector<int> out_;
  std::vector<double> points_;
  std::vector<int32_t> corners_;
  std::unordered_map<int64_t, int32_t> vertices_;
};

}  // namespace

TriangleSurface OffsetSurface(const DistanceGrid& grid, double distance) {
  return Marcher(grid, distance).Run();
}

}  // namespace deform
