// Half-edge work on surfaces. The only door to OpenMesh: no other file includes
// it.
#pragma once

#include <cstdint>

#include "absl/functional/function_ref.h"
#include "core/mesh/triangle_surface.h"
#include "core/mesh/types.h"

namespace deform {

// Collapses edges of a closed manifold surface, least quadric error first
// (Garland, Heckbert 1997), until `target_faces` are left or no collapse is
// allowed. Collapses keep the surface closed and manifold and turn no normal by
// more than 60 degrees; `allows` is asked for each triangle that one would
// make. Positions should be of size 1: errors are float inside.
TriangleSurface Decimate(
    const TriangleSurface& surface, int64_t target_faces,
    absl::FunctionRef<bool(const Vec3&, const Vec3&, const Vec3&)> allows);

}  // namespace deform
