// Outlines: loops of directed edges in a plane.
#pragma once

#include <cstdint>

#include "absl/functional/function_ref.h"
#include "core/mesh/triangle_surface.h"
#include "core/mesh/types.h"

namespace deform {

// Closed loops of directed edges, the inside on their left.
struct Outline {
  Positions positions;  // z = 0.
  Faces edges;          // E x 2.
};

// Where the plane z = `level` cuts a closed manifold surface that is oriented
// outward. Vertices of the surface should lie off the plane: at one that does
// not, several of the outline's may coincide. O(F).
Outline Slice(const TriangleSurface& surface, double level);

// Takes vertices out, those first that lie nearest to the line between their
// neighbours, until `target_edges` are left or none may go. `allows` is asked
// for the triangle of a vertex and its neighbours, which the outline is drawn
// across. Loops keep three edges at least, and loops that do not cross each
// other still do not: no other vertex lies in such a triangle. O(E^2).
Outline Simplify(
    const Outline& outline, int64_t target_edges,
    absl::FunctionRef<bool(const Vec3&, const Vec3&, const Vec3&)> allows);

}  // namespace deform
