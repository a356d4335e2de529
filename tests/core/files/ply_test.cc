#include <limits>
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

template <typename T>
void Append(std::string& bytes, bool big, T value) {
  const size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  StoreNumber(value, big, &bytes[at]);
}

constexpr char kAscii[] =
    "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nobj_info x\r\n"
    "element vertex 3\r\nproperty uchar red\r\nproperty float x\r\n"
    "property double y\r\nproperty float32 z\r\n"
    "element face 1\r\nproperty list uchar int vertex_indices\r\n"
    "property uchar flags\r\nend_header\r\n"
    "255 0 0 0\r\n7 1 0 0.5\r\n9 0 1 0\r\n3 0 1 2 7\r\n";

// The same with two more elements, of which one has a list of shorts.
std::string Binary(bool big) {
  std::string bytes = absl::StrCat(
      "ply\nformat binary_", big ? "big" : "little",
      "_endian 1.0\ncomment a comment\n"
      "element camera 1\nproperty list uint short view\nproperty float f\n"
      "element vertex 3\nproperty float x\nproperty double y\n"
      "property uchar red\nproperty float z\n"
      "element face 1\nproperty uchar flags\n"
      "property list ushort uint vertex_index\n"
      "element edge 1\nproperty int vertex1\nproperty int vertex2\n"
      "end_header\n");
  Append<uint32_t>(bytes, big, 2);
  Append<int16_t>(bytes, big, 1);
  Append<int16_t>(bytes, big, 2);
  Append<float>(bytes, big, 0.5f);
  for (int v = 0; v < 3; ++v) {
    Append<float>(bytes, big, v == 1 ? 1.f : 0.f);
    Append<double>(bytes, big, v == 2 ? 0.1 : 0.0);
    Append<uint8_t>(bytes, big, 200 + v);
    Append<float>(bytes, big, v == 1 ? 0.25f : 0.f);
  }
  Append<uint8_t>(bytes, big, 1);
  Append<uint16_t>(bytes, big, 3);
  for (uint32_t corner = 0; corner < 3; ++corner) Append(bytes, big, corner);
  Append<int32_t>(bytes, big, 0);
  Append<int32_t>(bytes, big, 1);
  return bytes;
}

TEST(Ply, ReadsAscii) {
  const auto file = ParseMesh(kAscii, "ply");
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_EQ(file->positions.rows(), 3);
  EXPECT_EQ(file->positions.row(1), Eigen::RowVector3d(1, 0, 0.5));
  ASSERT_EQ(file->faces.rows(), 1);
  EXPECT_EQ(file->faces.row(0), Eigen::RowVector3i(0, 1, 2));
}

TEST(Ply, ReadsBinaryOfEitherByteOrder) {
  for (const bool big : {false, true}) {
    const auto file = ParseMesh(Binary(big), "ply");
    ASSERT_TRUE(file.ok()) << file.status();
    ASSERT_EQ(file->positions.rows(), 3);
    EXPECT_EQ(file->positions.row(1), Eigen::RowVector3d(1, 0, 0.25));
    EXPECT_EQ(file->positions.row(2), Eigen::RowVector3d(0, 0.1, 0));
    ASSERT_EQ(file->faces.rows(), 1);
    EXPECT_EQ(file->faces.row(0), Eigen::RowVector3i(0, 1, 2));
  }
}

TEST(Ply, IsWrittenInItsOwnPrecisionAndAllElseKept) {
  const auto ascii = ParseMesh(kAscii, "ply");
  Positions posed = ascii->positions;
  EXPECT_EQ(*WithPositions(*ascii, posed), kAscii);
  posed.row(1) << 0.1, 0.1, 0.5;
  std::string expected = kAscii;
  expected.replace(expected.find("7 1 0 0.5"), 9, "7 0.1 0.1 0.5");
  EXPECT_EQ(*WithPositions(*ascii, posed), expected);
  posed(1, 0) = 1.0 / 3;
  EXPECT_THAT(*WithPositions(*ascii, posed), HasSubstr("7 0.33333334 0.1 0.5"));
  for (const bool big : {false, true}) {
    const auto file = ParseMesh(Binary(big), "ply");
    posed = file->positions;
    EXPECT_EQ(*WithPositions(*file, posed), Binary(big));
    posed.row(1) << 1.0 / 3, 1.0 / 3, -2;
    const std::string written = *WithPositions(*file, posed);
    EXPECT_EQ(written.size(), Binary(big).size());
    const auto again = ParseMesh(written, "ply");
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(again->positions.row(1),
              Eigen::RowVector3d(1.0f / 3, 1.0 / 3, -2));
    EXPECT_EQ(again->faces, file->faces);
  }
}

TEST(Ply, RefusesPositionsThatItsFloatsCannotHold) {
  const auto file = ParseMesh(kAscii, "ply");
  Positions posed = file->positions;
  posed(2, 1) = 1e39;
  EXPECT_TRUE(WithPositions(*file, posed).ok());  // y is a double.
  posed(2, 0) = 1e39;
  const auto refused = WithPositions(*file, posed);
  EXPECT_EQ(DetailOf(refused.status()).reason, "COORDINATE_TOO_LARGE");
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("vertex 2"));
}

TEST(Ply, StepsOverElementsWithoutProperties) {
  const auto file = ParseMesh(
      "ply\nformat ascii 1.0\nelement nothing 4000000000\nelement vertex 1\n"
      "property double x\nproperty double y\nproperty double z\nend_header\n"
      "1 2 3",
      "ply");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->positions.row(0), Eigen::RowVector3d(1, 2, 0));
}

struct BadPly {
  std::string name;
  std::string bytes;
  std::string message;
};

class PlyRefuses : public testing::TestWithParam<BadPly> {};

TEST_P(PlyRefuses, AndSaysWhere) {
  const auto file = ParseMesh(GetParam().bytes, "ply");
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(DetailOf(file.status()).reason, "BAD_MESH_FILE");
  EXPECT_THAT(std::string(file.status().message()),
              HasSubstr(GetParam().message));
}

std::string Replaced(std::string text, const std::string& from,
                     const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

// One face with a list of the given types and bytes, little-endian.
std::string FaceList(const std::string& types, const std::string& bytes) {
  return absl::StrCat(
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
      "property float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list ",
      types, " vertex_indices\nend_header\n", std::string(12, '\0'), bytes);
}

std::string Doubles(std::initializer_list<double> values) {
  std::string bytes;
  for (const double value : values) Append(bytes, false, value);
  return bytes;
}

INSTANTIATE_TEST_SUITE_P(
    Files, PlyRefuses,
    testing::ValuesIn<BadPly>({
        {"Empty", "", "line 1: a PLY file begins with the line \"ply\""},
        {"SomethingElse", "solid x", "line 1: a PLY file begins"},
        {"EndsInTheHeader", "ply\nformat ascii 1.0\n",
         "line 2: the file ends before end_header"},
        {"NoFormat", "ply\nend_header\n", "line 2: the header names no format"},
        {"UnknownFormat", "ply\nformat utf8 1.0\n", "line 2: the format is"},
        {"UnknownKeyword", "ply\nformat ascii 1.0\nelemental\n",
         "line 3: \"elemental\" in the header"},
        {"ElementWithoutCount", "ply\nformat ascii 1.0\nelement vertex\n",
         "line 3: an element needs a name and a count"},
        {"NegativeElementCount", "ply\nformat ascii 1.0\nelement vertex -1\n",
         "line 3: an element needs"},
        {"PropertyOfNothing", "ply\nformat ascii 1.0\nproperty float x\n",
         "line 3: a property stands before the first element"},
        {"UnknownType", Replaced(kAscii, "float x", "half x"),
         "line 7: \"half\" is no property type"},
        {"PropertyWithoutName", Replaced(kAscii, "float x", "float"),
         "line 7: a property needs a name"},
        {"NoX", Replaced(kAscii, "float x", "float X"),
         "line 13: element vertex has 0 properties x, not one"},
        {"TwoY", Replaced(kAscii, "uchar red", "float y"),
         "has 2 properties y, not one"},
        {"WholeNumbersAsCoordinates", Replaced(kAscii, "float x", "int x"),
         "coordinate x must be of type float or double"},
        {"ListAsCoordinate", Replaced(kAscii, "float x", "list uchar float x"),
         "coordinate x must be of type float or double"},
        {"LyingCount", Replaced(Binary(false), "vertex 3", "vertex 3000000000"),
         "3000000000 of element vertex do not fit into the file"},
        {"LyingAsciiCount", Replaced(kAscii, "vertex 3", "vertex 4000000000"),
         "4000000000 of element vertex do not fit"},
        {"CountBeyondTheLast", Replaced(kAscii, "face 1", "face 3"),
         "line 17: a value is missing"},
        {"Truncated", Binary(true).substr(0, Binary(true).size() - 20),
         "do not fit into the file"},
        {"TruncatedInAList", FaceList("uchar int", "\3\0\0\0\0\1"),
         ": the file ends early"},
        {"WordAsCoordinate", Replaced(kAscii, "7 1 0 0.5", "7 1 x 0.5"),
         "line 15: \"x\" is no number"},
        {"Nan", Replaced(kAscii, "7 1 0 0.5", "7 1 nan 0.5"),
         "line 15: value \"nan\" is not finite"},
        {"IndexOutOfRange", Replaced(kAscii, "3 0 1 2 7", "3 0 1 3 7"),
         "line 17: refers to vertex 3 of 3"},
        {"NegativeIndex", Replaced(kAscii, "3 0 1 2 7", "3 0 -1 2 7"),
         "line 17: there is no vertex -1"},
        {"HalfIndex", Replaced(kAscii, "3 0 1 2 7", "3 0 0.5 2 7"),
         "line 17: there is no vertex 0.5"},
        {"NegativeListLength", FaceList("char int", "\xff"),
         "a list cannot have -1 items"},
        {"NanListLength",
         FaceList("double int",
                  Doubles({std::numeric_limits<double>::quiet_NaN()})),
         "a list cannot have nan items"},
        {"LyingListLength", FaceList("uint uchar", "\xff\xff\xff\x7f\1\2"),
         "the file ends early"},
        {"BinaryIndexOutOfRange", FaceList("uchar uchar", "\3\1\1\7"),
         ": refers to vertex 7 of 1"},
        {"BinaryNan",
         Replaced(FaceList("uchar uchar", std::string(1, '\0')),
                  std::string(12, '\0'),
                  std::string(8, '\0') + "\xff\xff\xff\xff"),
         "coordinate z of vertex 0 is not finite"},
        {"NoVertices",
         "ply\nformat ascii 1.0\nelement face 0\n"
         "property list uchar int vertex_indices\nend_header\n",
         "the file has no vertices"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
