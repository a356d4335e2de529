#include "tests/support/detailed_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

namespace deform {
namespace {

// How far the cage reaches in a direction: a body with six limbs.
double Reach(const Vec3& direction) {
  const Vec3 limbs[] = {{1, 0.1, 0.2},     {-0.9, 0.3, 0.1},  {0.2, 1, -0.2},
                        {-0.1, -0.8, 0.6}, {0.3, -0.7, -0.7}, {0, 0.2, 1}};
  double reach = 1;
  for (const Vec3& limb : limbs) {
    reach += std::exp(9 * (direction.dot(limb.normalized()) - 1));
  }
  return reach;
}

// A sphere of rings and two poles, stretched to its reach.
Shape CageWithLimbs(int rings, int segments) {
  const auto index = [&](int ring, int segment) {
    return 1 + ring * segments + segment % segments;
  };
  const int last = rings * segments + 1;
  Shape cage{Positions(last + 1, 3), Faces(2 * rings * segments, 3)};
  const auto place = [&](int i, const Vec3& direction) {
    cage.positions.row(i) = Reach(direction) * direction.transpose();
  };
  place(0, Vec3(0, 0, 1));
  place(last, Vec3(0, 0, -1));
  int64_t face = 0;
  for (int s = 0; s < segments; ++s) {
    for (int r = 0; r < rings; ++r) {
      const double polar = std::numbers::pi * (r + 1) / (rings + 1);
      const double around = 2 * std::numbers::pi * s / segments;
      place(index(r, s), {std::sin(polar) * std::cos(around),
                          std::sin(polar) * std::sin(around), std::cos(polar)});
      const int above = r == 0 ? 0 : index(r - 1, s + 1);
      const int below = r == rings - 1 ? last : index(r + 1, s);
      cage.faces.row(face++) << index(r, s), index(r, s + 1), above;
      cage.faces.row(face++) << index(r, s), below, index(r, s + 1);
    }
  }
  return cage;
}

// Numbers the lattice points of faces as they are first asked for; those on
// edges and corners are shared.
class Lattice {
 public:
  Lattice(const Shape& shape, int cells) : shape_(shape), cells_(cells) {}

  // The point of face f with these thirds of `cells`, which they sum up to.
  int32_t At(int64_t f, const std::array<int, 3>& parts) {
    std::vector<std::pair<int32_t, int>> key;
    Vec3 point = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      const int32_t corner = shape_.faces(f, k);
      if (parts[k] > 0) key.emplace_back(corner, parts[k]);
      point += shape_.positions.row(corner).transpose() * parts[k] / cells_;
    }
    const auto next = static_cast<int32_t>(points_.size());
    if (key.size() < 3) {
      std::sort(key.begin(), key.end());
      const auto [entry, is_new] = shared_.try_emplace(key, next);
      if (!is_new) return entry->second;
    }
    points_.push_back(point);
    return next;
  }

  const std::vector<Vec3>& points() const { return points_; }

 private:
  const Shape& shape_;
  const int cells_;
  std::map<std::vector<std::pair<int32_t, int>>, int32_t> shared_;
  std::vector<Vec3> points_;
};

// Every triangle cut into cells^2.
Shape Subdivided(const Shape& shape, int cells) {
  Lattice lattice(shape, cells);
  std::vector<std::array<int32_t, 3>> faces;
  for (int64_t f = 0; f < shape.faces.rows(); ++f) {
    // Row i of the lattice lies opposite corner 0; ids of two rows at a time.
    std::vector<int32_t> before = {lattice.At(f, {cells, 0, 0})};
    for (int i = 1; i <= cells; ++i) {
      std::vector<int32_t> row;
      for (int j = 0; j <= i; ++j) {
        row.push_back(lattice.At(f, {cells - i, i - j, j}));
      }
      for (int j = 0; j < i; ++j) {
        faces.push_back({before[j], row[j], row[j + 1]});
        if (j > 0) faces.push_back({before[j], before[j - 1], row[j]});
      }
      before = std::move(row);
    }
  }
  Shape fine{Positions(lattice.points().size(), 3), Faces(faces.size(), 3)};
  for (size_t i = 0; i < lattice.points().size(); ++i) {
    fine.positions.row(i) = lattice.points()[i];
  }
  for (size_t i = 0; i < faces.size(); ++i) {
    for (int k = 0; k < 3; ++k) fine.faces(i, k) = faces[i][k];
  }
  return fine;
}

// The part of the way from the origin to the cage at which the surface lies:
// folds, bumps and wrinkles, in [0.62, 0.96].
double Depth(const Vec3& x) {
  const auto wave = [&](double a, double b, double c, double phase) {
    return std::sin(a * x.x() + b * x.y() + c * x.z() + phase);
  };
  return 0.79 + 0.08 * wave(2, 3, -1, 0.3) * wave(-1, 2, 4, 1.1) +
         0.05 * wave(9, -7, 8, 0.5) * wave(6, 11, -5, 2.0) +
         0.03 * wave(33, 25, -29, 0.2) + 0.01 * wave(-87, 95, 71, 0.7);
}

}  // namespace

DetailedModel MakeDetailedModel(int rings, int segments, int detail) {
  DetailedModel made{.cage = CageWithLimbs(rings, segments)};
  made.model = Subdivided(made.cage, detail);
  for (auto row : made.model.positions.rowwise()) {
    const Vec3 x = row.transpose();
    row = Depth(x) * x.transpose();
  }
  return made;
}

}  // namespace deform
