#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/files/mesh_file.h"

namespace deform {
namespace {

using testing::HasSubstr;

TEST(Off, ReadsVerticesAndFaces) {
  const auto file = ParseMesh(
      "OFF # a comment\n\n4 3 6\n0 0 0\n1 0 0 # another\n0 1 0\n\n0 0 0.1\n"
      "3 0 1 2\n3  0 2 3 255 0 0\n2 0 1\n",
      "off");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->positions.rows(), 4);
  EXPECT_EQ(file->positions(3, 2), 0.1);
  ASSERT_EQ(file->faces.rows(), 2);
  EXPECT_EQ(file->faces.row(1), Eigen::RowVector3i(0, 2, 3));
  ASSERT_EQ(file->edges.rows(), 1);
  EXPECT_EQ(file->edges.row(0), Eigen::RowVector2i(0, 1));
}

TEST(Off, MayLackItsHeaderOrCarryColoursAndNormals) {
  EXPECT_EQ(ParseMesh("2 0 0\n1 2 3\n0 0 0", "off")->positions(0, 2), 3);
  EXPECT_EQ(ParseMesh("COFF 1 0 0\n1 2 3 255 0 0 1\n", "off")->positions(0, 0),
            1);
  EXPECT_EQ(ParseMesh("STCNOFF\n1 0 0\n1 2 3 9 9 9\n", "OFF")->positions(0, 1),
            2);
}

TEST(Off, IsWrittenWithItsPositionsReplaced) {
  const auto file =
      ParseMesh("COFF\n2 0 0\n0 0 0 255 0 0\n1 0 5 0 255 0 # c\n", "off");
  ASSERT_TRUE(file.ok()) << file.status();
  Positions posed = file->positions;
  posed(1, 1) = 0.1;
  EXPECT_EQ(*WithPositions(*file, posed),
            "COFF\n2 0 0\n0 0 0 255 0 0\n1 0.1 5 0 255 0 # c\n");
}

struct BadOff {
  std::string name;
  std::string text;
  std::string message;
};

class OffRefuses : public testing::TestWithParam<BadOff> {};

TEST_P(OffRefuses, AndSaysWhere) {
  const auto file = ParseMesh(GetParam().text, "off");
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(DetailOf(file.status()).reason, "BAD_MESH_FILE");
  EXPECT_THAT(std::string(file.status().message()),
              HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Files, OffRefuses,
    testing::ValuesIn<BadOff>({
        {"Empty", "", "\"\" is no number of vertices"},
        {"OnlyTheHeader", "OFF\n", "line 1: \"\" is no number of vertices"},
        {"FourCoordinates", "4OFF\n1 0 0\n0 0 0 1\n",
         "line 1: \"4OFF\": only files with three coordinates"},
        {"Binary", "OFF BINARY\n\1\2\3", "line 1: binary OFF files"},
        {"NegativeCount", "OFF\n-3 0 0\n", "line 2: \"-3\" is no number"},
        {"NoFaceCount", "OFF\n3", "\"\" is no number of faces"},
        {"LyingVertexCount", "OFF\n2000000000 0 0\n0 0 0\n",
         "line 2: 2000000000 vertices and 0 faces do not fit"},
        {"LyingFaceCount", "OFF\n1 2000000000 0\n0 0 0\n",
         "1 vertices and 2000000000 faces do not fit"},
        {"EndsBeforeAVertex", "OFF\n2 0 0\n0 0 0\n",
         "line 3: the file ends before vertex 1 of 2"},
        {"EndsBeforeAFace", "OFF\n1 1 0\n0 0 0\n",
         "the file ends before face 0 of 1"},
        {"MissingCoordinate", "OFF\n1 0 0\n0 0\n",
         "line 3: a coordinate is missing"},
        {"MissingCorner", "OFF\n1 1 0\n0 0 0\n3 0 0\n",
         "line 4: corner 2 of 3 is missing"},
        {"CornerIsAWord", "OFF\n1 1 0\n0 0 0\n3 0 x 0\n",
         "line 4: corner 1 of 3 is no number"},
        {"IndexOutOfRange", "OFF\n1 1 0\n0 0 0\n3 0 1 0\n",
         "line 4: refers to vertex 1 of 1"},
        {"LyingCornerCount", "OFF\n1 1 0\n0 0 0\n2000000000 0 0\n",
         "line 4: corner 2 of 2000000000 is missing"},
        {"NoVertices", "OFF\n0 0 0\n", "the file has no vertices"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
