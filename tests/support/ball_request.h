// Points in the unit ball to be bound, many of them close to its surface.
#pragma once

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "core/weights/binding.h"
#include "tests/support/shapes.h"

namespace deform {

// `count` points spread in the disk or ball around `center`, many of them close
// to the cage of the property tests and, all the more, within its handles'
// hull.
inline BindRequest InBall(const CoordinateScheme& scheme, int dimension,
                          int count, const Vec3& center = Vec3::Zero()) {
  Shape rig = dimension == 2 ? RegularLoop2d(1, 19) : Icosphere(1, 1);
  std::mt19937 random(6);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  Positions points = Positions::Zero(count, 3);
  for (auto point : points.rowwise()) {
    for (int d = 0; d < dimension; ++d) point(d) = normal(random);
    point *= (1 - std::pow(uniform(random), 3)) * 0.78 / point.norm();
  }
  points.rowwise() += center.transpose();
  rig.positions.rowwise() += center.transpose();
  BindRequest request{.model = std::make_shared<const Mesh>(
                          *Mesh::Create(dimension, points, Faces(0, 3))),
                      .rig = CageOf(rig),
                      .scheme = std::string(scheme.id())};
  if (scheme.rig_kind() == RigKind::kHandles) {
    request.rig = *Handles::Create(dimension, rig.positions);
  }
  return request;
}

}  // namespace deform
