// Triangles over grids: what the generated shapes are made of.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "core/mesh/types.h"

namespace deform {

struct Surface {
  Positions positions;
  Faces faces;
};

// The unit sphere, each of the 20 triangles of an icosahedron cut into
// cells x cells: 10 cells^2 + 2 points.
Surface UnitSphere(int cells);

// A box whose sides are grids of cells[0] x cells[1] x cells[2] rectangles.
Surface BoxSurface(const Vec3& min, const Vec3& max,
                   const std::array<int, 3>& cells);

// Around the z axis: a tube of radius `minor` at distance `major`.
Surface TorusSurface(double major, double minor, int around, int across);

// 2D: those of columns x rows unit cells that `within` names (by column and
// row), side `cell`.
Surface CellSurface(int columns, int rows, double cell,
                    const std::function<bool(int, int)>& within);

// 2D: the loop through `corners`, counter-clockwise, each side cut in `cuts`.
Surface LoopThrough(std::span<const Eigen::Vector2d> corners, int cuts);

}  // namespace deform
