#include "tests/bench/scenes.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/shapes.h"

namespace deform::bench {
namespace {

using std::numbers::pi;

// In the direction of latitude and longitude, in radians.
Vec3 OnOrgan(double latitude, double longitude) {
  const double dent = 1 + 0.2 * std::sin(2 * longitude + 0.5) *
                              std::cos(3 * latitude) * std::cos(latitude);
  return dent * Vec3(1.4 * std::cos(latitude) * std::cos(longitude),
                     std::cos(latitude) * std::sin(longitude),
                     0.8 * std::sin(latitude));
}

double LeafRadius(double angle) { return 1 + 0.25 * std::sin(3 * angle); }

}  // namespace

Cage OrganCage(int rings, int segments) {
  Shape shape;
  shape.positions.resize(int64_t{rings} * segments + 2, 3);
  shape.faces.resize(2 * int64_t{rings} * segments, 3);
  const int south = rings * segments, north = south + 1;
  shape.positions.row(south) = OnOrgan(-pi / 2, 0);
  shape.positions.row(north) = OnOrgan(pi / 2, 0);
  int64_t f = 0;
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const int at = r * segments + s;
      const int next = r * segments + (s + 1) % segments;
      shape.positions.row(at) =
          OnOrgan(pi * (r + 1) / (rings + 1) - pi / 2,
                  2 * pi * (s + 0.5 * (r % 2)) / segments);
      if (r == 0) shape.faces.row(f++) << south, next, at;
      if (r == rings - 1) {
        shape.faces.row(f++) << north, at, next;
        continue;
      }
      const int above = at + segments, next_above = next + segments;
      if (r % 2 == 0) {
        shape.faces.row(f++) << at, next, above;
        shape.faces.row(f++) << next, next_above, above;
      } else {
        shape.faces.row(f++) << at, next, next_above;
        shape.faces.row(f++) << at, next_above, above;
      }
    }
  }
  return CageOf(shape);
}

Positions OrganPoints(int64_t count) {
  Positions points(count, 3);
  const double turns = std::sqrt(static_cast<double>(count)) / 2;
  for (int64_t i = 0; i < count; ++i) {
    const double share = (i + 0.5) / count;
    const double latitude = std::asin(2 * share - 1);
    points.row(i) = 0.8 * OnOrgan(latitude, 2 * pi * turns * share);
  }
  return points;
}

Handles HandlesAround(int64_t count) {
  Positions around = OrganPoints(count);
  for (int64_t i = 0; i < count; ++i) {
    around.row(i) = 2 * around.row(i).normalized();
  }
  return Handles::Create(3, around).value();
}

Cage LeafCage(int corners) {
  std::vector<Eigen::Vector2d> loop;
  for (int k = 0; k < corners; ++k) {
    const double angle = 2 * pi * k / corners;
    loop.push_back(LeafRadius(angle) *
                   Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return CageOf(Loop2d(loop));
}

Positions LeafPoints(int64_t count) {
  Positions points = Positions::Zero(count, 3);
  const double turns = std::sqrt(static_cast<double>(count)) / 2;
  for (int64_t i = 0; i < count; ++i) {
    const double share = (i + 0.5) / count;
    const double angle = 2 * pi * turns * share;
    const double r = 0.9 * std::sqrt(share) * LeafRadius(angle);
    points.row(i) << r * std::cos(angle), r * std::sin(angle), 0;
  }
  return points;
}

}  // namespace deform::bench
