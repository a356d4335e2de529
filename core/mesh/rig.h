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
// V x 3: cage vertices, or handles, of which the last may be fixed.
inline const Positions& RestVertices(const Rig& rig) {
  return std::visit(
      [](const auto& r) -> const Positions& { return RestVertices(r); }, rig);
}

// InvalidArgument DIMENSION_MISMATCH.
absl::Status CheckSameDimension(const Mesh& model, int rig_dimension);

// The first so many vertices are those that a pose moves.
inline int64_t PoseRows(const Rig& rig) {
  const auto* handles = std::get_if<Handles>(&rig);
  return handles != nullptr ? handles->free_count() : RestVertices(rig).rows();
}

}  // namespace deform
