// Generated models and cages for tests.
#pragma once

#include <cstdint>
#include <span>

#include "core/mesh/cage.h"
#include "core/mesh/mesh.h"
#include "core/mesh/types.h"

namespace deform {

// Points with triangles (3D surfaces and 2D models) or directed edges (2D
// cages). Closed ones are oriented outward, loops counter-clockwise.
struct Shape {
  Positions positions;
  Faces faces;
};

// 8 vertices, 12 triangles.
Shape Cuboid(const Vec3& min, const Vec3& max);
// A box whose sides are grids of cells[0] x cells[1] x cells[2] squares.
Shape Bar(const Vec3& min, const Vec3& max, std::span<const int, 3> cells);
Shape Tetrahedron();
// 20 * 4^subdivisions triangles, vertices on the sphere.
Shape Icosphere(double radius, int subdivisions);
// Around the z axis: a tube of radius `minor` at distance `major`.
Shape Torus(double major, double minor, int around, int across);
// Along z from 0 to `length`, both ends open.
Shape Tube(double radius, double length, int around, int along);

// The unit square in cells x cells squares of two triangles, z = 0.
Shape Grid2d(int cells);
// Directed edges through the corners in turn and back to the first.
Shape Loop2d(std::span<const Eigen::Vector2d> corners);
// Corners on the circle of `radius`.
Shape RegularLoop2d(double radius, int corners);

// `shape` with its faces turned.
Shape Turned(Shape shape);
// x -> scale (x - centre of the bounding box) + centre + offset: a cage around
// a convex shape, for scale > 1.
Shape Scaled(Shape shape, double scale, const Vec3& offset = Vec3::Zero());
// Both, as components.
Shape Joined(const Shape& a, const Shape& b);

// Right by construction; ends the program otherwise. Faces of two corners make
// a 2D cage.
Mesh MeshOf(const Shape& shape, int dimension = 3);
Cage CageOf(const Shape& shape);

}  // namespace deform
