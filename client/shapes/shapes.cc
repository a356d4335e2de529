#include "client/shapes/shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/shapes/surfaces.h"
#include "core/base/error.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

constexpr int64_t kLeastPoints = 100;
constexpr int64_t kMostPoints = 1'000'000;

// What of 1 is left at `distance` from a bump's middle.
double Bump(double distance, double width) {
  return std::exp(-distance * distance / (width * width));
}

// Where a point of the unit sphere lies on the heart: an ellipsoid drawn out to
// an apex that points down and to the side, a groove around it between its
// halves, and the stumps of three vessels on top.
Vec3 HeartPoint(const Vec3& u) {
  const double down = std::max(0.0, -u.z());
  const double slim = 1 - 0.45 * down * down;
  Vec3 p(0.86 * slim * u.x(), 0.70 * slim * u.y(), 1.05 * u.z());
  p.x() += 0.34 * down * down;
  const double groove = Bump(Vec3(0.86, 0.42, 0.28).normalized().dot(u), 0.11) *
                        std::clamp(0.7 - u.z(), 0.0, 1.0) * (1 - 0.9 * down);
  p *= 1 - 0.10 * groove;
  struct Vessel {
    Vec3 at;
    double height, width;
  };
  static const Vessel kVessels[] = {{{0.10, 0.05, 1}, 0.42, 0.26},
                                    {{-0.62, 0.25, 0.95}, 0.30, 0.27},
                                    {{0.66, -0.30, 0.90}, 0.26, 0.30}};
  for (const Vessel& vessel : kVessels) {
    const Vec3 axis = vessel.at.normalized();
    p += vessel.height * Bump((u - axis).norm(), vessel.width) *
         (0.35 * axis + 0.65 * Vec3::UnitZ());
  }
  return p;
}

// The corners of `scale` times the box.
Positions BoxCorners(const Box& box, double scale, int dimension) {
  const int count = dimension == 3 ? 8 : 4;
  Positions corners = Positions::Zero(count, 3);
  for (int k = 0; k < count; ++k) {
    for (int d = 0; d < dimension; ++d) {
      const double side = 0.5 * scale * (box.max[d] - box.min[d]);
      corners(k, d) = box.center()[d] + ((k >> d & 1) != 0 ? side : -side);
    }
  }
  return corners;
}

Positions Joined(const Positions& a, const Positions& b) {
  Positions both(a.rows() + b.rows(), 3);
  both << a, b;
  return both;
}

GeneratedShape Organ(int64_t points) {
  const int cells =
      std::max(3, static_cast<int>(std::lround(std::sqrt(points / 10.0))));
  const Surface sphere = UnitSphere(cells);
  GeneratedShape shape;
  shape.faces = sphere.faces;
  shape.positions.resize(sphere.positions.rows(), 3);
  for (int64_t i = 0; i < sphere.positions.rows(); ++i) {
    shape.positions.row(i) =
        HeartPoint(sphere.positions.row(i).transpose()).transpose();
  }
  // Four rings of six around it, one on its axis at each end, and one in the
  // middle. Next to the surface each would leave a dent of its own: both
  // schemes are only continuous at a handle.
  Positions inner(27, 3);
  int64_t row = 0;
  for (int ring = 0; ring < 4; ++ring) {
    const double height = 0.75 - 0.5 * ring;
    for (int k = 0; k < 6; ++k) {
      const double u = std::numbers::pi * (2 * k + ring) / 6;
      const double r = std::sqrt(1 - height * height);
      inner.row(row++) =
          1.3 *
          HeartPoint({r * std::cos(u), r * std::sin(u), height}).transpose();
    }
  }
  inner.row(row++) = 1.2 * HeartPoint({0, 0, 1}).transpose();
  inner.row(row++) = 1.2 * HeartPoint({0, 0, -1}).transpose();
  inner.row(row++) << 0.05, 0, -0.1;
  shape.handles = Joined(BoxCorners(BoxOf(shape.positions), 1.6, 3), inner);
  return shape;
}

GeneratedShape BarShape(int64_t points) {
  // 3 c x 3 c cells across and 20 c along make 258 c^2 points, about.
  const int c =
      std::max(1, static_cast<int>(std::lround(std::sqrt(points / 258.0))));
  const Surface bar =
      BoxSurface({-0.4, -0.4, 0.1}, {0.4, 0.4, 5.9}, {3 * c, 3 * c, 20 * c});
  const Surface cage = BoxSurface({-0.5, -0.5, 0}, {0.5, 0.5, 6}, {1, 1, 4});
  return {.positions = bar.positions,
          .faces = bar.faces,
          .cage = cage.positions,
          .cage_faces = cage.faces,
          .handles = cage.positions};
}

GeneratedShape TorusShape(int64_t points) {
  const int across =
      std::max(6, static_cast<int>(std::lround(std::sqrt(points / 3.0))));
  const Surface torus = TorusSurface(1, 0.32, 3 * across, across);
  const Surface cage = TorusSurface(1.02, 0.52, 12, 5);
  Positions ring(12, 3);
  for (int k = 0; k < 12; ++k) {
    const double u = 2 * std::numbers::pi * k / 12;
    ring.row(k) << std::cos(u), std::sin(u), 0;
  }
  return {.positions = torus.positions,
          .faces = torus.faces,
          .cage = cage.positions,
          .cage_faces = cage.faces,
          .handles = Joined(BoxCorners(BoxOf(torus.positions), 1.6, 3), ring)};
}

GeneratedShape Flat(int64_t points, double share,
                    std::span<const Eigen::Vector2d> corners,
                    const std::function<bool(double, double)>& within) {
  // Even, so that the middle is a line of the grid.
  const int half = std::max(
      5, static_cast<int>(std::lround(0.5 * std::sqrt(points / share))));
  const int cells = 2 * half;
  const Surface plate =
      CellSurface(cells, cells, 1.0 / cells, [&](int i, int j) {
        return within((i + 0.5) / cells, (j + 0.5) / cells);
      });
  const Surface cage = LoopThrough(corners, 2);
  return {.dimension = 2,
          .positions = plate.positions,
          .faces = plate.faces,
          .cage = cage.positions,
          .cage_faces = cage.faces,
          .handles = cage.positions};
}

GeneratedShape Plate(int64_t points) {
  const Eigen::Vector2d corners[] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  return Flat(points, 1, corners, [](double, double) { return true; });
}

GeneratedShape Angle(int64_t points) {
  const Eigen::Vector2d corners[] = {{0, 0},     {1, 0},   {1, 0.5},
                                     {0.5, 0.5}, {0.5, 1}, {0, 1}};
  return Flat(points, 0.75, corners,
              [](double x, double y) { return x < 0.5 || y < 0.5; });
}

struct Named {
  const char* name;
  GeneratedShape (*make)(int64_t points);
};
constexpr Named kShapes[] = {{"organ", Organ},
                             {"bar", BarShape},
                             {"torus", TorusShape},
                             {"plate", Plate},
                             {"angle", Angle}};

}  // namespace

const std::vector<std::string>& ShapeNames() {
  static const auto& names = *[] {
    auto* const list = new std::vector<std::string>;
    for (const Named& shape : kShapes) list->push_back(shape.name);
    return list;
  }();
  return names;
}

absl::StatusOr<GeneratedShape> GenerateShape(const std::string& name,
                                             int64_t points) {
  if (points < kLeastPoints || points > kMostPoints) {
    return InvalidInput("INVALID_OPTION", "points",
                        absl::StrCat("a shape has ", kLeastPoints, " to ",
                                     kMostPoints, " points, not ", points));
  }
  for (const Named& shape : kShapes) {
    if (name == shape.name) return shape.make(points);
  }
  return MakeError(absl::StatusCode::kNotFound,
                   absl::StrCat("there is no shape '", name,
                                "': ", absl::StrJoin(ShapeNames(), ", ")),
                   {.reason = "UNKNOWN_SHAPE", .field = "name"});
}

}  // namespace deform
