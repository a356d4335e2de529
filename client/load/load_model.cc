#include "client/load/load_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/shapes/surfaces.h"
#include "core/mesh/handles.h"

namespace deform {
namespace {

// The ball reaches from 0.85 to 1.15, the handles lie within it. The cage is
// wide enough for that inside the flattest of its shapes, the icosahedron,
// whose faces are 0.79 of its corners away.
constexpr double kBumps = 0.15;
constexpr double kCage = 1.6;
constexpr double kHandles = 0.8;
constexpr double kGrowth = 1e-3;  // From one number to the next.

int CellsFor(double triangles_or_points, double each) {
  return std::max(
      1, static_cast<int>(std::lround(std::sqrt(triangles_or_points / each))));
}

// n points, spread evenly over the unit sphere along a spiral with the golden
// angle.
Positions Spiral(int64_t n) {
  Positions points(n, 3);
  const double golden = std::numbers::pi * (3 - std::sqrt(5));
  for (int64_t i = 0; i < n; ++i) {
    const double z =
        1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(n);
    const double r = std::sqrt(1 - z * z);
    const double turn = golden * static_cast<double>(i);
    points.row(i) << r * std::cos(turn), r * std::sin(turn), z;
  }
  return points;
}

}  // namespace

LoadModel MakeLoadModel(int64_t points, int64_t cage_faces, int64_t handles,
                        int64_t number) {
  const double size = 1 + kGrowth * static_cast<double>(number);
  Surface ball = UnitSphere(CellsFor(static_cast<double>(points), 10));
  for (int64_t i = 0; i < ball.positions.rows(); ++i) {
    const Vec3 p = ball.positions.row(i);
    ball.positions.row(i) *=
        size * (1 + kBumps * std::sin(5 * p.x()) * std::cos(4 * p.z()));
  }
  LoadModel result;
  result.model = ModelArrays(3, ball.positions, ball.faces);
  if (handles > 0) {
    result.spec.scheme = "s_cc";
    result.spec.rig = RigArrays(RigKind::kHandles, 3,
                                size * kHandles * Spiral(handles), Faces());
    const auto mesh = Mesh::Create(3, ball.positions, ball.faces);
    result.spec.rig.fixed = BoxHandles(*mesh);
  } else {
    const Surface cage =
        UnitSphere(CellsFor(static_cast<double>(cage_faces), 20));
    result.spec.rig =
        RigArrays(RigKind::kCage, 3, size * kCage * cage.positions, cage.faces);
  }
  return result;
}

}  // namespace deform
