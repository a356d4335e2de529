#include "client/shapes/surfaces.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>

#include <Eigen/Geometry>

namespace deform {
namespace {

// Numbers points as they are first asked for, by a key that names their place.
template <typename Key>
class Builder {
 public:
  int32_t Point(const Key& key, const Vec3& place) {
    const auto [entry, is_new] =
        index_.try_emplace(key, static_cast<int32_t>(points_.size()));
    if (is_new) points_.push_back(place);
    return entry->second;
  }
  void Triangle(int32_t a, int32_t b, int32_t c) {
    triangles_.push_back({a, b, c});
  }
  // Corners in turn.
  void Quad(int32_t a, int32_t b, int32_t c, int32_t d) {
    Triangle(a, b, c);
    Triangle(a, c, d);
  }
  Surface Build() const {
    Surface surface{Positions(points_.size(), 3), Faces(triangles_.size(), 3)};
    for (size_t i = 0; i < points_.size(); ++i) {
      surface.positions.row(i) = points_[i].transpose();
    }
    for (size_t f = 0; f < triangles_.size(); ++f) {
      for (int k = 0; k < 3; ++k) surface.faces(f, k) = triangles_[f][k];
    }
    return surface;
  }

 private:
  std::map<Key, int32_t> index_;
  std::vector<Vec3> points_;
  std::vector<std::array<int32_t, 3>> triangles_;
};

struct Icosahedron {
  std::array<Vec3, 12> corners;
  std::vector<std::array<int, 3>> faces;
};

Icosahedron MakeIcosahedron() {
  Icosahedron solid;
  // The poles lie on z, two rings of five between them.
  solid.corners[0] = {0, 0, 1};
  solid.corners[11] = {0, 0, -1};
  const double z = 1 / std::sqrt(5), r = 2 / std::sqrt(5);
  for (int k = 0; k < 5; ++k) {
    const double u = 2 * std::numbers::pi * k / 5;
    const double v = u + std::numbers::pi / 5;
    solid.corners[1 + k] = {r * std::cos(u), r * std::sin(u), z};
    solid.corners[6 + k] = {r * std::cos(v), r * std::sin(v), -z};
  }
  for (int k = 0; k < 5; ++k) {
    const int next = (k + 1) % 5;
    solid.faces.push_back({0, 1 + k, 1 + next});
    solid.faces.push_back({1 + k, 6 + k, 1 + next});
    solid.faces.push_back({1 + next, 6 + k, 6 + next});
    solid.faces.push_back({11, 6 + next, 6 + k});
  }
  return solid;
}

}  // namespace

Surface UnitSphere(int cells) {
  // Weights of the corners a point lies between name it, whatever the face.
  using Key = std::map<int, int>;
  Builder<Key> builder;
  const Icosahedron solid = MakeIcosahedron();
  for (const auto& face : solid.faces) {
    const auto point = [&](int i, int j) {
      const int weights[3] = {cells - i - j, i, j};
      Key key;
      Vec3 place = Vec3::Zero();
      for (int k = 0; k < 3; ++k) {
        if (weights[k] > 0) key[face[k]] = weights[k];
        place += weights[k] * solid.corners[face[k]];
      }
      return builder.Point(key, place.normalized());
    };
    for (int i = 0; i < cells; ++i) {
      for (int j = 0; i + j < cells; ++j) {
        builder.Triangle(point(i, j), point(i + 1, j), point(i, j + 1));
        if (i + j + 1 == cells) continue;
        builder.Triangle(point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
      }
    }
  }
  return builder.Build();
}

Surface BoxSurface(const Vec3& min, const Vec3& max,
                   const std::array<int, 3>& cells) {
  Builder<std::array<int, 3>> builder;
  const auto point = [&](std::array<int, 3> at) {
    Vec3 place;
    for (int d = 0; d < 3; ++d) {
      place[d] = min[d] + (max[d] - min[d]) * at[d] / cells[d];
    }
    return builder.Point(at, place);
  };
  for (int d = 0; d < 3; ++d) {
    const int u = (d + 1) % 3, v = (d + 2) % 3;
    for (const int side : {0, cells[d]}) {
      for (int i = 0; i < cells[u]; ++i) {
        for (int j = 0; j < cells[v]; ++j) {
          const auto corner = [&](int di, int dj) {
            std::array<int, 3> at;
            at[d] = side;
            at[u] = i + di;
            at[v] = j + dj;
            return point(at);
          };
          // Outward is towards larger d on the far side only.
          if (side > 0) {
            builder.Quad(corner(0, 0), corner(1, 0), corner(1, 1),
                         corner(0, 1));
          } else {
            builder.Quad(corner(0, 0), corner(0, 1), corner(1, 1),
                         corner(1, 0));
          }
        }
      }
    }
  }
  return builder.Build();
}

Surface TorusSurface(double major, double minor, int around, int across) {
  Builder<std::array<int, 2>> builder;
  const auto point = [&](int i, int j) {
    const double u = 2 * std::numbers::pi * i / around;
    const double v = 2 * std::numbers::pi * j / across;
    const double r = major + minor * std::cos(v);
    return builder.Point(
        {i % around, j % across},
        Vec3(r * std::cos(u), r * std::sin(u), minor * std::sin(v)));
  };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      builder.Quad(point(i, j), point(i + 1, j), point(i + 1, j + 1),
                   point(i, j + 1));
    }
  }
  return builder.Build();
}

Surface CellSurface(int columns, int rows, double cell,
                    const std::function<bool(int, int)>& within) {
  Builder<std::array<int, 2>> builder;
  const auto point = [&](int i, int j) {
    return builder.Point({i, j}, Vec3(cell * i, cell * j, 0));
  };
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      if (!within(i, j)) continue;
      builder.Quad(point(i, j), point(i + 1, j), point(i + 1, j + 1),
                   point(i, j + 1));
    }
  }
  return builder.Build();
}

Surface LoopThrough(std::span<const Eigen::Vector2d> corners, int cuts) {
  const auto sides = static_cast<int32_t>(corners.size());
  const int32_t count = sides * cuts;
  Surface loop{Positions::Zero(count, 3), Faces(count, 2)};
  for (int32_t i = 0; i < count; ++i) {
    const Eigen::Vector2d& from = corners[i / cuts];
    const Eigen::Vector2d& to = corners[(i / cuts + 1) % sides];
    const double t = static_cast<double>(i % cuts) / cuts;
    loop.positions.row(i).head<2>() = ((1 - t) * from + t * to).transpose();
    loop.faces.row(i) << i, (i + 1) % count;
  }
  return loop;
}

}  // namespace deform
