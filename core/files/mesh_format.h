// The seam for mesh formats. To add one: write formats/<name>.cc, then add one
// line to builtin_formats.cc.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace deform {

// How a number stands in a file.
enum class NumberEncoding : uint8_t {
  kText,       // Any double.
  kFloatText,  // Text that the file declares to be float32.
  kFloatLittle,
  kFloatBig,
  kDoubleLittle,
  kDoubleBig,
};

// Bytes of a file that hold one coordinate.
struct NumberSlot {
  uint64_t offset = 0;
  // Vertex, or N + facet for the coordinates of a facet's normal.
  uint32_t row = 0;
  uint16_t length = 0;
  uint8_t axis = 0;
  NumberEncoding encoding = NumberEncoding::kText;
};

// A file's faces as they stand there: polygon p has sizes[p] of the corners.
struct Polygons {
  std::vector<int32_t> corners;
  std::vector<int32_t> sizes;
};

// What a format finds in a file.
struct ParsedMesh {
  std::vector<double> coordinates;  // Three a vertex, all finite.
  Polygons polygons;                // Corners are below the number of vertices.
  std::vector<int32_t> edges;       // Two corners each, likewise.
  std::vector<NumberSlot> slots;    // In order of offset, none overlapping.
};

// Adds a face as formats mean it: three corners or more are a polygon, two an
// edge; fewer say nothing.
void AddFace(ParsedMesh& mesh, std::span<const int32_t> corners);

// Has no state: one object serves every thread.
struct MeshFormat {
  absl::string_view name;
  // Never crashes, whatever the bytes, and allocates in proportion to them.
  absl::StatusOr<ParsedMesh> (*parse)(absl::string_view bytes);
};

// In the order of builtin_formats.cc.
std::span<const MeshFormat* const> AllMeshFormats();

// InvalidArgument UNKNOWN_MESH_FORMAT that lists the known ones. `name` may be
// in either case.
absl::StatusOr<const MeshFormat*> FindMeshFormat(absl::string_view name);

// "line 12: ...", "byte 84: ...": InvalidArgument BAD_MESH_FILE.
absl::Status BadLine(int64_t line, absl::string_view what);
absl::Status BadByte(uint64_t offset, absl::string_view what);

}  // namespace deform
