#include "tests/fuzz/mesh_checks.h"

#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/files/loops.h"
#include "core/files/mesh_file.h"
#include "core/mesh/mesh.h"
#include "tests/fuzz/expect.h"

namespace deform {
namespace {

void CheckMoved(const char* format, const MeshFile& file) {
  Positions moved = file.positions * 0.5;
  moved.leftCols(2).array() += 0.3;
  const auto bytes = WithPositions(file, moved);
  // Floats may be too small for what was a large number behind a comma.
  if (!bytes.ok()) return;
  const auto again =
      ParseMesh(*bytes, format,
                file.dimension == 2 ? FileDimension::k2d : FileDimension::k3d);
  FUZZ_EXPECT(again.ok());
  // Vertices of an STL file that come together become one.
  if (file.format == "stl") return;
  FUZZ_EXPECT(again->positions.rows() == moved.rows());
  // Half a unit in the last place of a float.
  const auto error = (again->positions - moved).array().abs();
  FUZZ_EXPECT((error <= 1e-7 * moved.array().abs() + 1e-45).all());
  FUZZ_EXPECT(again->edges == file.edges);
  FUZZ_EXPECT(again->faces.rows() == file.faces.rows());
}

}  // namespace

void CheckMeshFormat(const char* format, const uint8_t* data, size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const auto file = ParseMesh(bytes, format);
  if (!file.ok()) {
    FUZZ_EXPECT(file.status().code() == absl::StatusCode::kInvalidArgument);
    FUZZ_EXPECT(!DetailOf(file.status()).reason.empty());
    FUZZ_EXPECT(!file.status().message().empty());
    return;
  }
  FUZZ_EXPECT(Mesh::Create(file->dimension, file->positions, file->faces).ok());
  FUZZ_EXPECT(CheckIndices(file->edges, file->positions.rows(), "").ok());
  const auto unmoved = WithPositions(*file, file->positions);
  FUZZ_EXPECT(unmoved.ok() && *unmoved == bytes);
  if (file->dimension == 2) {
    (void)OrientLoops(file->positions, file->edges).status().ok();
  }
  CheckMoved(format, *file);
}

}  // namespace deform
