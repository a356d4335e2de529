#include "tests/support/shapes.h"

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

namespace deform {
namespace {

using Corners = std::vector<std::array<int32_t, 3>>;

Positions PositionsOf(const std::vector<Vec3>& points) {
  Positions positions(points.size(), 3);
  for (size_t i = 0; i < points.size(); ++i) positions.row(i) = points[i];
  return positions;
}

Faces FacesOf(const Corners& corners) {
  Faces faces(corners.size(), 3);
  for (size_t f = 0; f < corners.size(); ++f) {
    for (int k = 0; k < 3; ++k) faces(f, k) = corners[f][k];
  }
  return faces;
}

// Triangles of a grid of rows x columns cells; vertex (i, j) has the number
// index(i, j). Counter-clockwise where j runs to the left of i.
template <typename Index>
void AddGrid(int rows, int columns, Index index, Corners& corners) {
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const int32_t a = index(i, j);
      const int32_t b = index(i + 1, j);
      const int32_t c = index(i + 1, j + 1);
      const int32_t d = index(i, j + 1);
      corners.push_back({a, b, c});
      corners.push_back({a, c, d});
    }
  }
}

// Numbers the points of a lattice as they are first asked for.
class LatticePoints {
 public:
  int32_t At(const std::array<int, 3>& key, const Vec3& point) {
    const auto [entry, is_new] =
        index_.try_emplace(key, static_cast<int32_t>(points_.size()));
    if (is_new) points_.push_back(point);
    return entry->second;
  }
  Positions positions() const { return PositionsOf(points_); }

 private:
  std::map<std::array<int, 3>, int32_t> index_;
  std::vector<Vec3> points_;
};

}  // namespace

Shape Cuboid(const Vec3& min, const Vec3& max) {
  return Bar(min, max, std::array{1, 1, 1});
}

Shape Bar(const Vec3& min, const Vec3& max, std::span<const int, 3> cells) {
  LatticePoints points;
  Corners corners;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    for (const bool far : {false, true}) {
      const auto index = [&](int i, int j) {
        std::array<int, 3> key{};
        key[axis] = far ? cells[axis] : 0;
        key[u] = i;
        key[v] = j;
        Vec3 point;
        for (int k = 0; k < 3; ++k) {
          point[k] = min[k] + (max[k] - min[k]) * key[k] / cells[k];
        }
        return points.At(key, point);
      };
      if (far) {
        AddGrid(cells[u], cells[v], index, corners);
      } else {
        AddGrid(
            cells[v], cells[u], [&](int i, int j) { return index(j, i); },
            corners);
      }
    }
  }
  return {points.positions(), FacesOf(corners)};
}

Shape Tetrahedron() {
  return {PositionsOf({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}),
          FacesOf({{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}})};
}

Shape Icosphere(double radius, int subdivisions) {
  const double g = std::numbers::phi;
  std::vector<Vec3> points = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                              {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                              {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  Corners corners = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10},
                     {0, 10, 11}, {1, 5, 9},  {5, 11, 4}, {11, 10, 2},
                     {10, 7, 6},  {7, 1, 8},  {3, 9, 4},  {3, 4, 2},
                     {3, 2, 6},   {3, 6, 8},  {3, 8, 9},  {4, 9, 5},
                     {2, 4, 11},  {6, 2, 10}, {8, 6, 7},  {9, 8, 1}};
  for (int s = 0; s < subdivisions; ++s) {
    std::map<std::pair<int32_t, int32_t>, int32_t> middles;
    const auto middle = [&](int32_t a, int32_t b) {
      const auto [entry, is_new] = middles.try_emplace(
          std::minmax(a, b), static_cast<int32_t>(points.size()));
      if (is_new) points.push_back((points[a] + points[b]) / 2);
      return entry->second;
    };
    Corners finer;
    for (const auto& [a, b, c] : corners) {
      const int32_t ab = middle(a, b);
      const int32_t bc = middle(b, c);
      const int32_t ca = middle(c, a);
      finer.insert(finer.end(),
                   {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    corners = std::move(finer);
  }
  for (Vec3& point : points) point *= radius / point.norm();
  return {PositionsOf(points), FacesOf(corners)};
}

Shape Torus(double major, double minor, int around, int across) {
  std::vector<Vec3> points;
  for (int i = 0; i < around; ++i) {
    const double u = 2 * std::numbers::pi * i / around;
    for (int j = 0; j < across; ++j) {
      const double v = 2 * std::numbers::pi * j / across;
      const double r = major + minor * std::cos(v);
      points.emplace_back(r * std::cos(u), r * std::sin(u),
                          minor * std::sin(v));
    }
  }
  Corners corners;
  AddGrid(
      around, across,
      [&](int i, int j) { return (i % around) * across + j % across; },
      corners);
  return {PositionsOf(points), FacesOf(corners)};
}

Shape Tube(double radius, double length, int around, int along) {
  std::vector<Vec3> points;
  for (int j = 0; j <= along; ++j) {
    for (int i = 0; i < around; ++i) {
      const double u = 2 * std::numbers::pi * i / around;
      points.emplace_back(radius * std::cos(u), radius * std::sin(u),
                          length * j / along);
    }
  }
  Corners corners;
  AddGrid(
      around, along, [&](int i, int j) { return j * around + i % around; },
      corners);
  return {PositionsOf(points), FacesOf(corners)};
}

Shape Grid2d(int cells) {
  std::vector<Vec3> points;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      points.emplace_back(double(i) / cells, double(j) / cells, 0);
    }
  }
  Corners corners;
  AddGrid(
      cells, cells, [&](int i, int j) { return j * (cells + 1) + i; }, corners);
  return {PositionsOf(points), FacesOf(corners)};
}

Shape Loop2d(std::span<const Eigen::Vector2d> corners) {
  const auto count = static_cast<int32_t>(corners.size());
  Shape loop{Positions::Zero(count, 3), Faces(count, 2)};
  for (int32_t i = 0; i < count; ++i) {
    loop.positions.row(i).head<2>() = corners[i];
    loop.faces.row(i) << i, (i + 1) % count;
  }
  return loop;
}

Shape RegularLoop2d(double radius, int corners) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < corners; ++i) {
    const double u = 2 * std::numbers::pi * i / corners;
    points.emplace_back(radius * std::cos(u), radius * std::sin(u));
  }
  return Loop2d(points);
}

Shape Turned(Shape shape) {
  shape.faces.col(0).swap(shape.faces.col(1));
  return shape;
}

Shape Scaled(Shape shape, double scale, const Vec3& offset) {
  const Vec3 center = BoxOf(shape.positions).center();
  for (auto row : shape.positions.rowwise()) {
    row = (scale * (row.transpose() - center) + center + offset).transpose();
  }
  return shape;
}

Shape Joined(const Shape& a, const Shape& b) {
  Shape both{Positions(a.positions.rows() + b.positions.rows(), 3),
             Faces(a.faces.rows() + b.faces.rows(), a.faces.cols())};
  both.positions << a.positions, b.positions;
  both.faces << a.faces,
      (b.faces.array() + static_cast<int32_t>(a.positions.rows())).matrix();
  return both;
}

Mesh MeshOf(const Shape& shape, int dimension) {
  return Mesh::Create(dimension, shape.positions, shape.faces).value();
}

Cage CageOf(const Shape& shape) {
  return Cage::Create(static_cast<int>(shape.faces.cols()), shape.positions,
                      shape.faces)
      .value();
}

}  // namespace deform
