#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/files/mesh_file.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

MeshFile Parse(const std::string& text,
               FileDimension dimension = FileDimension::kAutomatic) {
  auto file = ParseMesh(text, "obj", dimension);
  EXPECT_TRUE(file.ok()) << file.status();
  return file.ok() ? *std::move(file) : MeshFile();
}

Faces FacesFrom(std::initializer_list<std::initializer_list<int32_t>> rows) {
  Faces faces(rows.size(), rows.begin()->size());
  int64_t f = 0;
  for (const auto& row : rows) {
    std::copy(row.begin(), row.end(), faces.row(f++).data());
  }
  return faces;
}

constexpr char kTriangle[] = "v 0 0 0\nv 1 0 0.5\nv 0 1 0\n";

TEST(Obj, ReadsVerticesAndFacesInTheirOrder) {
  const MeshFile file = Parse(std::string(kTriangle) +
                              "v 1 1 1\n"
                              "f 1 2 3\nf 4 3 2\n");
  EXPECT_EQ(file.format, "obj");
  EXPECT_EQ(file.dimension, 3);
  ASSERT_EQ(file.positions.rows(), 4);
  EXPECT_EQ(file.positions.row(1), Eigen::RowVector3d(1, 0, 0.5));
  EXPECT_EQ(file.faces, FacesFrom({{0, 1, 2}, {3, 2, 1}}));
  EXPECT_EQ(file.edges.rows(), 0);
}

TEST(Obj, ReadsEveryFormOfIndex) {
  const MeshFile file = Parse(std::string(kTriangle) +
                              "vt 0 0\nvn 0 0 1\n"
                              "f 1/1 2/1 3/1\nf 1//1 2//1 3//1\n"
                              "f 1/1/1 2/1/1 3/1/1\nf -3 -2 -1\n"
                              "f -3/-1/-1 -2/-1/-1 -1/-1/-1\n");
  ASSERT_EQ(file.faces.rows(), 5);
  for (int f = 0; f < 5; ++f) {
    EXPECT_EQ(file.faces.row(f), Eigen::RowVector3i(0, 1, 2)) << f;
  }
}

TEST(Obj, KeepsTheVertexOrderOfSeveralMeshes) {
  const MeshFile file = Parse(
      "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
      "o b\nv 5 0 1\nv 6 0 1\nv 5 1 1\nf -3 -2 -1\n");
  ASSERT_EQ(file.positions.rows(), 6);
  EXPECT_EQ(file.positions(3, 0), 5);
  EXPECT_EQ(file.faces, FacesFrom({{0, 1, 2}, {3, 4, 5}}));
}

TEST(Obj, ReadsPolylinesAsEdges) {
  const MeshFile file =
      Parse("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nl 1 2 3\nl 3/1 -1 1\n");
  EXPECT_EQ(file.dimension, 2);
  EXPECT_EQ(file.edges, FacesFrom({{0, 1}, {1, 2}, {2, 3}, {3, 0}}));
}

TEST(Obj, AcceptsWhatWritersDo) {
  // Windows and old Macintosh line ends, a joined line, comments, a plus sign,
  // weights and colours behind the coordinates, no end of the last line.
  const MeshFile file = Parse(
      "# made by hand\r\n\r\nmtllib x.mtl\rv +1 2e0 .5 # here\r\n"
      "\tv  0 0 0 1.0\nv 1 \\\n 0 \\\r\n 0 0.1 0.2 0.3\nusemtl m\ns off\n"
      "f 1 2 3");
  ASSERT_EQ(file.positions.rows(), 3);
  EXPECT_EQ(file.positions.row(0), Eigen::RowVector3d(1, 2, 0.5));
  EXPECT_EQ(file.positions.row(2), Eigen::RowVector3d(1, 0, 0));
  EXPECT_EQ(file.faces.rows(), 1);
}

TEST(Obj, RoundsNumbersExactly) {
  // Halfway between two doubles, many digits, subnormal, underflow to 0.
  const MeshFile file = Parse(
      "v 9007199254740993 0.1000000000000000055511151231257827021181583404541 "
      "3e-324\nv 1e-999 1 0\n");
  EXPECT_EQ(file.positions(0, 0), 9007199254740992.0);
  EXPECT_EQ(file.positions(0, 1), 0.1);
  EXPECT_EQ(file.positions(0, 2), 5e-324);
  EXPECT_EQ(file.positions(1, 0), 0);
}

TEST(Obj, IsPlanarIn2dUnlessAskedOtherwise) {
  const std::string plane = "v 0 0 7\nv 1 0 7\nv 0 1 7\nf 1 2 3\n";
  const MeshFile flat = Parse(plane);
  EXPECT_EQ(flat.dimension, 2);
  EXPECT_TRUE((flat.positions.col(2).array() == 0).all());
  const MeshFile solid = Parse(plane, FileDimension::k3d);
  EXPECT_EQ(solid.dimension, 3);
  EXPECT_TRUE((solid.positions.col(2).array() == 7).all());
  const auto refused = ParseMesh(kTriangle, "obj", FileDimension::k2d);
  EXPECT_EQ(DetailOf(refused.status()).reason, "NOT_PLANAR");
  EXPECT_EQ(refused.status().message(),
            "a 2D file has one z for all vertices; vertex 0 has 0, vertex 1 "
            "has 0.5");
}

TEST(Obj, IsWrittenWithItsPositionsReplacedAndAllElseKept) {
  const std::string source =
      "# cube\nmtllib a.mtl\nv 0 0 0 0.1 0.2 0.3 # red\r\nv  1\t0 0.50\n"
      "vt 0.25 0.5\nv 0 1 0\nusemtl m\nf 1/1 2/1 3/1\n";
  const MeshFile file = Parse(source);
  Positions posed = file.positions;
  EXPECT_EQ(*WithPositions(file, posed), source);
  posed.row(0) << 0.1, -2, 1e-20;
  posed(2, 1) = 1.0 / 3;
  EXPECT_EQ(*WithPositions(file, posed),
            "# cube\nmtllib a.mtl\nv 0.1 -2 1e-20 0.1 0.2 0.3 # red\r\n"
            "v  1\t0 0.50\nvt 0.25 0.5\nv 0 0.3333333333333333 0\nusemtl m\n"
            "f 1/1 2/1 3/1\n");
}

TEST(Obj, KeepsItsZIn2d) {
  const MeshFile file = Parse("v 0 0 7\nv 1 0 7\n");
  Positions posed = file.positions;
  posed.row(1) << 2, 3, 0;
  EXPECT_EQ(*WithPositions(file, posed), "v 0 0 7\nv 2 3 7\n");
}

TEST(Obj, TextReadsBackBitByBit) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  Shape shape = Icosphere(1, 1);
  for (double& x : shape.positions.reshaped()) x = number(random) * 1e-7;
  const MeshFile file = Parse(ObjText(shape.positions, shape.faces));
  EXPECT_EQ(file.positions, shape.positions);
  EXPECT_EQ(file.faces, shape.faces);
  const Shape loop = RegularLoop2d(3, 7);
  const MeshFile flat = Parse(ObjText(loop.positions, loop.faces));
  EXPECT_EQ(flat.positions, loop.positions);
  EXPECT_EQ(flat.edges, loop.faces);
}

struct BadObj {
  std::string name;
  std::string text;
  std::string message;
};

class ObjRefuses : public testing::TestWithParam<BadObj> {};

TEST_P(ObjRefuses, AndSaysWhere) {
  const auto file = ParseMesh(GetParam().text, "obj");
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(file.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(file.status().message()),
              HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Files, ObjRefuses,
    testing::ValuesIn<BadObj>({
        {"Empty", "", "the file has no vertices"},
        {"SomethingElse",
         "\x7f"
         "ELF\x02\x01",
         "the file has no vertices"},
        {"MissingCoordinate", "v 1 2\n", "line 1: a coordinate is missing"},
        {"NotANumber", "v 0 0 0\nv 1 2 3x\n",
         "line 2: \"3x\" is no number (a coordinate was expected)"},
        {"PlusMinus", "v +-1 2 3\n", "line 1: \"+-1\" is no number"},
        {"Nan", "v 1 nan 3\n", "line 1: coordinate \"nan\" is not finite"},
        {"Infinite", "v 1 -inf 3\n", "line 1: coordinate \"-inf\""},
        {"Overflow", "v 1 1e999 3\n", "line 1: coordinate \"1e999\""},
        {"TooLarge", "v 1 1e101 3\n",
         "vertex 0 has a coordinate beyond 1e+100"},
        {"EndlessNumber", "v 1 " + std::string(2000, '1') + " 3\n",
         "line 1: \"1111"},
        {"IndexBeyondTheLast", "v 0 0 0\nf 1 1 1\nf 1 2 1\n",
         "line 3: refers to vertex 2 of 1"},
        {"IndexBeforeTheFirst", "v 0 0 0\nf -1 -1 -2\n",
         "line 2: refers to vertex -2; 1 stand before it"},
        {"IndexZero", "v 0 0 0\nf 0 1 1\n",
         "line 2: \"0\" refers to no vertex"},
        {"HugeIndex", "v 0 0 0\nf 1 1 99999999999\n",
         "line 2: refers to vertex 99999999999"},
        {"IndexBeyond64Bits", "v 0 0 0\nf 1 1 99999999999999999999999\n",
         "line 2: \"99999999999999999999999\" refers to no vertex"},
        {"IndexIsAWord", "v 0 0 0\nl 1 b/1\n",
         "line 2: \"b/1\" refers to no vertex"},
        {"LineNumberAfterJoinedLines", "v 0 0 \\\n 0\nf 9 9 9\n",
         "line 3: refers to vertex 9 of 1"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
