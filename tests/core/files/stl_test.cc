#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/files/mesh_file.h"
#include "core/files/number_bytes.h"

namespace deform {
namespace {

using testing::HasSubstr;

// Two triangles that share the edge (1 0 0), (0 1 0).
constexpr char kAscii[] =
    "solid two of them\n"
    " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1.0 0 0\n"
    "   vertex 0 1 0\n  endloop\n endfacet\n"
    " facet normal nan 0 0\n  outer loop\n   vertex 0 1 0\n   vertex 1 -0 0\n"
    "   vertex 1 1 1\n  endloop\n endfacet\nendsolid two of them\n";

std::string Binary() {
  std::string bytes = "solid by its looks, but binary";
  bytes.resize(84);
  StoreNumber<uint32_t>(2, false, &bytes[80]);
  const float facets[2][12] = {{0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0},
                               {0, 0, 0, 0, 1, 0, 1, -0.f, 0, 1, 1, 1}};
  for (const auto& facet : facets) {
    for (const float number : facet) {
      bytes.resize(bytes.size() + 4);
      StoreNumber(number, false, &bytes[bytes.size() - 4]);
    }
    bytes += "ab";
  }
  return bytes;
}

void ExpectTwoTriangles(const std::string& bytes) {
  const auto file = ParseMesh(bytes, "stl");
  ASSERT_TRUE(file.ok()) << file.status();
  Positions expected(4, 3);
  expected << 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1;
  EXPECT_EQ(file->positions, expected);
  Faces faces(2, 3);
  faces << 0, 1, 2, 2, 1, 3;
  EXPECT_EQ(file->faces, faces);
}

TEST(Stl, WeldsEqualCornersInOrderOfFirstOccurrence) {
  ExpectTwoTriangles(kAscii);
  ExpectTwoTriangles(Binary());
}

TEST(Stl, MayHoldSeveralSolidsInAnyCase) {
  const std::string upper =
      "SOLID\nFACET NORMAL 0 0 1 OUTER LOOP VERTEX 0 0 0 VERTEX 1 0 0 VERTEX 0 "
      "1 0 ENDLOOP ENDFACET\nENDSOLID\n";
  const auto file = ParseMesh(upper + "  " + kAscii, "stl");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->faces.rows(), 3);
  EXPECT_EQ(file->positions.rows(), 4);
}

TEST(Stl, IsWrittenWithNewNormalsWhereItMoved) {
  const auto file = ParseMesh(kAscii, "stl");
  Positions posed = file->positions;
  EXPECT_EQ(*WithPositions(*file, posed), kAscii);
  posed.row(3) << 1, 1, 0;
  const std::string expected =
      "solid two of them\n"
      " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1.0 0 0\n"
      "   vertex 0 1 0\n  endloop\n endfacet\n"
      " facet normal 0 0 1\n  outer loop\n   vertex 0 1 0\n   vertex 1 -0 0\n"
      "   vertex 1 1 0\n  endloop\n endfacet\nendsolid two of them\n";
  EXPECT_EQ(*WithPositions(*file, posed), expected);
  // A facet that loses its area has no normal.
  posed.row(3) << 2, -1, 0;
  EXPECT_THAT(*WithPositions(*file, posed), HasSubstr("normal 0 0 0\n"));
}

TEST(Stl, IsWrittenBinaryAsItWas) {
  const auto file = ParseMesh(Binary(), "stl");
  Positions posed = file->positions;
  EXPECT_EQ(*WithPositions(*file, posed), Binary());
  posed(1, 0) = 1.0 / 3;
  const std::string written = *WithPositions(*file, posed);
  const auto again = ParseMesh(written, "stl");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->positions(1, 0), 1.0f / 3);
  EXPECT_EQ(again->faces, file->faces);
  EXPECT_EQ(written.substr(0, 96), Binary().substr(0, 96));
  EXPECT_EQ(written.substr(84 + 48, 2), "ab");
}

struct BadStl {
  std::string name;
  std::string bytes;
  std::string message;
};

class StlRefuses : public testing::TestWithParam<BadStl> {};

TEST_P(StlRefuses, AndSaysWhere) {
  const auto file = ParseMesh(GetParam().bytes, "stl");
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(DetailOf(file.status()).reason, "BAD_MESH_FILE");
  EXPECT_THAT(std::string(file.status().message()),
              HasSubstr(GetParam().message));
}

std::string WithBytes(std::string bytes, size_t at, const std::string& with) {
  return bytes.replace(at, with.size(), with);
}

std::string Ascii(const std::string& facet) {
  return absl::StrCat("solid\nfacet ", facet);
}

INSTANTIATE_TEST_SUITE_P(
    Files, StlRefuses,
    testing::ValuesIn<BadStl>({
        {"Empty", "", "byte 0: neither ascii STL"},
        {"Short", std::string(83, 'x'), "byte 83: neither ascii STL"},
        {"NoTriangles", std::string(84, '\0'), "the file has no vertices"},
        {"LyingCount",
         WithBytes(WithBytes(Binary(), 0, "x"), 80, "\xff\xff\xff\xff"),
         "byte 80: the file announces 4294967295 triangles and has room for 2"},
        {"Truncated", "x" + Binary().substr(1, Binary().size() - 2),
         "byte 80: the file announces 2 triangles and has room for 1"},
        {"Nan", WithBytes(Binary(), 84 + 12, "\xff\xff\xff\xff"),
         "byte 96: a coordinate of triangle 0 is not finite"},
        {"NoFacets", "solid x\nendsolid x\n", "the file has no vertices"},
        {"StrayWord", "solid x\nvertex 0 0 0\n",
         "line 2: \"vertex\" stands where \"facet\" should be"},
        {"EndsInAFacet", Ascii("normal 0 0 1\nouter loop\nvertex 0 0 0\n"),
         "line 4: the file ends where \"vertex\" should be"},
        {"EndsInANumber", Ascii("normal 0 0"), "line 2: a number is missing"},
        {"FourCorners",
         Ascii("normal 0 0 1\nouter loop\nvertex 0 0 0 vertex 0 0 1 vertex 0 1 "
               "0 vertex 1 1 1"),
         "line 4: \"vertex\" stands where \"endloop\" should be"},
        {"WordAsCoordinate", Ascii("normal 0 0 1\nouter loop\nvertex 0 zero 0"),
         "line 4: \"zero\" is no number"},
        {"AsciiNan", Ascii("normal 0 0 1\nouter loop\nvertex 0 nan 0"),
         "line 4: coordinate \"nan\" is not finite"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
