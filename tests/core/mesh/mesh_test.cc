#include "core/mesh/mesh.h"

#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

void ExpectRefused(int dimension, const Shape& shape, const std::string& reason,
                   const std::string& message) {
  const auto mesh = Mesh::Create(dimension, shape.positions, shape.faces);
  ASSERT_FALSE(mesh.ok());
  EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(mesh.status()).reason, reason);
  EXPECT_EQ(mesh.status().message(), message);
}

TEST(Mesh, KeepsOrderAndKnowsItsBox) {
  const Shape box = Cuboid({1, 2, 3}, {2, 4, 7});
  const auto mesh = Mesh::Create(3, box.positions, box.faces);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->positions(), box.positions);
  EXPECT_EQ(mesh->faces(), box.faces);
  EXPECT_EQ(mesh->box().min, Vec3(1, 2, 3));
  EXPECT_EQ(mesh->box().max, Vec3(2, 4, 7));
}

TEST(Mesh, MayBePointsOnlyOrOpenOrDegenerate) {
  Shape grid = Grid2d(2);
  grid.faces.row(0) << 0, 0, 0;
  EXPECT_EQ(Mesh::Create(2, grid.positions, grid.faces).status(),
            absl::OkStatus());
  EXPECT_EQ(Mesh::Create(3, grid.positions, Faces(0, 3)).status(),
            absl::OkStatus());
}

TEST(Mesh, RefusesWhatIsNoModel) {
  const Shape box = Cuboid({0, 0, 0}, {1, 1, 1});
  ExpectRefused(5, box, "BAD_DIMENSION", "dimension must be 2 or 3, not 5");
  ExpectRefused(3, {Positions(0, 3), Faces(0, 3)}, "EMPTY_MODEL",
                "a model needs at least one vertex");
  ExpectRefused(2, box, "NOT_PLANAR", "a 2D model must lie in the plane z = 0");
  ExpectRefused(3, {box.positions, Faces::Zero(1, 2)}, "BAD_FACES",
                "faces of a model are triangles");
  Shape bad = box;
  bad.positions(7, 0) = std::numeric_limits<double>::infinity();
  ExpectRefused(3, bad, "NON_FINITE",
                "vertex 7 has a coordinate that is not finite");
  bad.positions(7, 0) = -1e101;
  ExpectRefused(3, bad, "COORDINATE_TOO_LARGE",
                "vertex 7 has a coordinate beyond 1e+100");
  bad = box;
  bad.faces(11, 2) = 8;
  ExpectRefused(3, bad, "INDEX_OUT_OF_RANGE",
                "face 11 refers to vertex 8 of 8");
}

}  // namespace
}  // namespace deform
