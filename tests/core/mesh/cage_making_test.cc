#include "core/mesh/cage_making.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/mesh/self_intersection.h"
#include "core/mesh/triangle.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

// Coarser than the default, to be quick.
constexpr CageMakingOptions kOptions{.target_faces = 120, .margin = 0.12};

double Distance(const Shape& surface, const Vec3& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& face : surface.faces.rowwise()) {
    const Vec3 on_face = ClosestOnTriangle(
        point, surface.positions.row(face[0]), surface.positions.row(face[1]),
        surface.positions.row(face[2]));
    nearest = std::min(nearest, (on_face - point).norm());
  }
  return nearest;
}

struct Model {
  std::string name;
  Shape shape;
  // Vertices - edges + faces of the cage: 2 a sphere, 0 a torus.
  int euler;
};

class MadeCage : public testing::TestWithParam<Model> {};

TEST_P(MadeCage, EnclosesTheModelClosely) {
  const Shape& shape = GetParam().shape;
  const Mesh model = MeshOf(shape);
  const auto cage = MakeCage(model, kOptions);
  ASSERT_TRUE(cage.ok()) << cage.status();
  EXPECT_LE(cage->face_count(), 2 * kOptions.target_faces);
  EXPECT_EQ(cage->vertex_count() - cage->face_count() / 2, GetParam().euler);
  EXPECT_FALSE(FindSelfIntersection(cage->vertices(), cage->faces()));

  const double margin = kOptions.margin * model.box().diagonal();
  const Shape surface{cage->vertices(), cage->faces()};
  for (const auto& row : model.positions().rowwise()) {
    const Vec3 point = row;
    EXPECT_NEAR(WindingNumber(*cage, point), 1, 1e-9);
    EXPECT_GE(Distance(surface, point), margin / 4);
  }
  // The margin may have been widened threefold, not more.
  if (shape.faces.rows() == 0) return;
  for (const auto& row : cage->vertices().rowwise()) {
    EXPECT_LE(Distance(shape, row), 3.1 * margin);
  }
}

Shape PointsOnly(Shape shape) {
  shape.faces.resize(0, 3);
  return shape;
}

Shape Moved(Shape shape, double scale, const Vec3& offset) {
  shape.positions *= scale;
  shape.positions.rowwise() += offset.transpose();
  return shape;
}

const Shape kSphere = Icosphere(1, 2);

INSTANTIATE_TEST_SUITE_P(
    CageMaking, MadeCage,
    testing::ValuesIn<Model>({
        {"Sphere", kSphere, 2},
        {"Torus", Torus(2, 0.4, 32, 12), 0},
        {"OpenTube", Tube(0.3, 4, 16, 20), 2},
        {"Bar", Bar({0, 0, 0}, {1, 1, 4}, std::array{3, 3, 8}), 2},
        // Thinner than any lattice, and open.
        {"Sheet", Grid2d(12), 2},
        {"PointSet", PointsOnly(kSphere), 2},
        {"HollowWithCore", Joined(kSphere, Scaled(kSphere, 0.2)), 2},
        {"TwoParts", Joined(kSphere, Scaled(kSphere, 1, {0, 4, 0})), 4},
        {"InsideOut", Turned(kSphere), 2},
        {"FarAway", Moved(kSphere, 1e-3, {1e4, -1e4, 0}), 2},
        {"Huge", Moved(kSphere, 1e30, {0, 0, 0}), 2},
        {"SingleTriangle",
         {Tetrahedron().positions.topRows(3), Tetrahedron().faces.topRows(1)},
         2},
    }),
    [](const auto& test) { return test.param.name; });

// The unit square, with a hole in the middle if `cells` are taken out.
Shape SquareWithHole(int cells) {
  const Shape grid = Grid2d(12);
  Shape shape{grid.positions, Faces(grid.faces.rows(), 3)};
  int64_t count = 0;
  for (const auto& face : grid.faces.rowwise()) {
    const Vec3 middle =
        (grid.positions.row(face[0]) + grid.positions.row(face[1]) +
         grid.positions.row(face[2])) /
        3;
    const double off =
        std::max(std::abs(middle.x() - 0.5), std::abs(middle.y() - 0.5));
    if (off > cells / 24.0) shape.faces.row(count++) = face;
  }
  shape.faces.conservativeResize(count, 3);
  // Every point counts: those in the hole go elsewhere.
  for (int64_t v = 0; v < shape.positions.rows(); ++v) {
    if (!(shape.faces.array() == v).any()) {
      shape.positions.row(v) = shape.positions.row(0);
    }
  }
  return shape;
}

TEST(CageMaking, MakesLoopsAroundA2dModel) {
  const Mesh model = MeshOf(Grid2d(12), 2);
  const auto cage = MakeCage(model, {.target_faces = 12, .margin = 0.1});
  ASSERT_TRUE(cage.ok()) << cage.status();
  EXPECT_EQ(cage->dimension(), 2);
  EXPECT_LE(cage->face_count(), 24);
  EXPECT_EQ(cage->vertex_count(), cage->face_count());
  const double margin = 0.1 * model.box().diagonal();
  for (const auto& row : model.positions().rowwise()) {
    const Vec3 point = row;
    EXPECT_NEAR(WindingNumber(*cage, point), 1, 1e-9);
    for (const auto& edge : cage->faces().rowwise()) {
      const Vec3 near = ClosestOnSegment(point, cage->vertices().row(edge[0]),
                                         cage->vertices().row(edge[1]));
      EXPECT_GE((near - point).norm(), margin / 4);
    }
  }
}

TEST(CageMaking, MakesALoopAroundAWideHoleOfA2dModel) {
  const CageMakingOptions options{.margin = 0.04};
  const auto ring = MakeCage(MeshOf(SquareWithHole(6), 2), options);
  ASSERT_TRUE(ring.ok()) << ring.status();
  EXPECT_NEAR(WindingNumber(*ring, {0.5, 0.5, 0}), 0, 1e-9);
  const auto whole = MakeCage(MeshOf(SquareWithHole(0), 2), options);
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_NEAR(WindingNumber(*whole, {0.5, 0.5, 0}), 1, 1e-9);
}

void ExpectRefused(const Mesh& model, const CageMakingOptions& options,
                   const std::string& reason, const std::string& message) {
  const auto cage = MakeCage(model, options);
  EXPECT_EQ(DetailOf(cage.status()).reason, reason);
  EXPECT_THAT(std::string(cage.status().message()), HasSubstr(message));
}

TEST(CageMaking, RefusesWhatItCannotDo) {
  const Mesh model = MeshOf(kSphere);
  ExpectRefused(model, {.target_faces = 7}, "INVALID_OPTION",
                "between 8 and 20000, not 7");
  ExpectRefused(model, {.target_faces = 20001}, "INVALID_OPTION", "not 20001");
  ExpectRefused(model, {.margin = 0.001}, "INVALID_OPTION",
                "between 0.01 and 1 diagonals of the model, not 0.001");
  ExpectRefused(model, {.margin = std::numeric_limits<double>::quiet_NaN()},
                "INVALID_OPTION", "not nan");
  ExpectRefused(MeshOf({Positions::Ones(3, 3), Faces(0, 3)}), {},
                "MODEL_WITHOUT_EXTENT", "all points of the model are at one");
}

}  // namespace
}  // namespace deform
