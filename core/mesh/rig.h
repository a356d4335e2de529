// What a model hangs on: a cage, or free handles.
#pragma once

#include <variant>

#include "core/mesh/cage.h"
#include "core/mesh/handles.h"

namespace deform {

using Rig = std::variant<Cage, Handles>;

inline int DimensionOf(const Rig& rig) {
  return std::visit([](const auto& r) { return r.dimension(); }, rig);
}
inline double DiagonalOf(const Rig& rig) {
  return std::visit([](const auto& r) { return r.diagonal(); }, rig);
}
inline const Positions& RestVertices(const Cage& cage) {
  return cage.vertices();
}
inline const Positions& RestVertices(const Handles& handles) {
  return handles.positions();
}
// V x 3: the rows that a pose replaces.
inline const Positions& RestVertices(const Rig& rig) {
  return std::visit(
      [](const auto& r) -> const Positions& { return RestVertices(r); }, rig);
}

}  // namespace deform
