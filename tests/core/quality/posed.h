// Bindings and poses whose quality is known.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

#include "core/weights/binding.h"
#include "tests/support/shapes.h"

namespace deform {

inline std::shared_ptr<const Binding> BindTo(const std::string& scheme,
                                             const Shape& model, Rig rig,
                                             ExitRegions exits = {}) {
  const int dimension = DimensionOf(rig);
  return Bind({.model = std::make_shared<const Mesh>(MeshOf(model, dimension)),
               .rig = std::move(rig),
               .scheme = scheme,
               .exits = std::move(exits),
               .unbindable = Unbindable::kReport},
              {})
      .value();
}

// A cage, or its corners as handles: whatever the scheme takes.
inline Rig RigFor(const std::string& scheme, const Shape& cage) {
  if ((*FindScheme(scheme))->rig_kind() == RigKind::kCage) return CageOf(cage);
  return Handles::Create(static_cast<int>(cage.faces.cols()), cage.positions)
      .value();
}

// 1 x 1 x 8 along z, five levels of four vertices.
inline Shape TowerCage() {
  return Bar({-0.5, -0.5, 0}, {0.5, 0.5, 8}, std::array{1, 1, 4});
}

// pi / 2 per level.
inline Positions Twisted(Positions rest) {
  for (auto row : rest.rowwise()) {
    const double angle = 0.5 * std::numbers::pi * row[2] / 2;
    const double x = row[0], y = row[1];
    row[0] = std::cos(angle) * x - std::sin(angle) * y;
    row[1] = std::sin(angle) * x + std::cos(angle) * y;
  }
  return rest;
}

}  // namespace deform
