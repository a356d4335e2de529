#include "core/files/mesh_file.h"

#include <filesystem>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace deform {
namespace {

using testing::HasSubstr;

TEST(ReadMeshFile, GoesByTheExtensionInEitherCase) {
  const std::string path =
      Temporary().Write("mesh_file_test.OBJ", "v 1 2 3\nv 4 5 6\n");
  const auto file = ReadMeshFile(path);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->format, "obj");
  EXPECT_EQ(file->positions(1, 1), 5);
}

TEST(ReadMeshFile, SaysWhichFileIsBad) {
  const std::string path = Temporary().Write("mesh_file_test.obj", "v 1 2\n");
  EXPECT_EQ(ReadMeshFile(path).status().message(),
            path + ": line 1: a coordinate is missing");
}

TEST(ReadMeshFile, RefusesWhatIsNotThere) {
  const auto read = ReadMeshFile("/nowhere/x.obj");
  EXPECT_EQ(read.status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(DetailOf(read.status()).reason, "FILE_NOT_FOUND");
  EXPECT_EQ(read.status().message(), "/nowhere/x.obj: there is no such file");
}

TEST(ReadMeshFile, RefusesADirectory) {
  const std::string path = Temporary().Path("mesh_file_test.ply");
  std::filesystem::create_directory(path);
  EXPECT_EQ(ReadMeshFile(path).status().code(), absl::StatusCode::kNotFound);
}

TEST(ReadMeshFile, RefusesUnknownFormatsAndListsTheKnown) {
  for (const char* path : {"model.dae", "model"}) {
    const auto read = ReadMeshFile(path);
    EXPECT_EQ(DetailOf(read.status()).reason, "UNKNOWN_MESH_FORMAT");
    EXPECT_THAT(std::string(read.status().message()),
                HasSubstr("is not a mesh format: obj, off, ply, stl are"));
  }
}

TEST(WithPositions, RefusesAnotherNumberOfVertices) {
  const auto file = ParseMesh("v 1 2 3\nv 0 0 0\n", "obj");
  const auto posed = WithPositions(*file, Positions::Zero(3, 3));
  EXPECT_EQ(DetailOf(posed.status()).reason, "WRONG_LENGTH");
  EXPECT_EQ(posed.status().message(), "the file has 2 vertices, not 3");
}

TEST(WithPositions, RefusesPositionsThatAreNotFinite) {
  const auto file = ParseMesh("v 1 2 3\nv 0 0 0\n", "obj");
  Positions positions = file->positions;
  positions(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(DetailOf(WithPositions(*file, positions).status()).reason,
            "NON_FINITE");
}

}  // namespace
}  // namespace deform
