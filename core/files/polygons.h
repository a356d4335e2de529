// Polygons into triangles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/files/mesh_format.h"
#include "core/mesh/types.h"

namespace deform {

// Corners of one polygon; ear clipping costs the square of this, or more.
inline constexpr int kMaxPolygonCorners = 1000;

// Triangles of the polygons, in their order; a polygon of k corners gives
// k - 2, of its own corners only, so poses are given on the file's vertices.
// The rule depends on nothing but the positions:
//   4 corners a b c d: of the diagonals ac and bd the shorter one whose two
//     triangles both agree with the polygon's Newell normal; ac if equal. If
//     neither agrees, the shorter one.
//   more: clips, one after the other, the convex corner without another corner
//     in its triangle, seen along the largest axis of the Newell normal, whose
//     cut is shortest, the first of equals; where a polygon crosses itself and
//     has no such corner, its first.
// Refuses polygons beyond kMaxPolygonCorners with BAD_MESH_FILE.
absl::StatusOr<Faces> Triangulate(const Polygons& polygons,
                                  const Positions& positions);

}  // namespace deform
