// Mesh files, for clients: the wire carries arrays and the server never parses
// a file.
//
// Numbers are read exactly rounded into doubles, vertices keep the file's
// order, and a posed model is the source file with its positions replaced:
// faces, texture coordinates, materials, comments, colours and the order of
// everything stay as they were.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/files/mesh_format.h"
#include "core/mesh/types.h"

namespace deform {

enum class FileDimension {
  // 2 if all vertices have the same z, else 3.
  kAutomatic,
  // Refuses a file whose z differ, with NOT_PLANAR.
  k2d,
  k3d,
};

struct MeshFile {
  // Name of the format, "obj".
  std::string format;
  int dimension = 3;
  // N x 3 in the file's order. In 2D z is 0, whatever the file's z is.
  Positions positions;
  // F x 3: the file's polygons, triangulated by the rule in polygons.h.
  Faces faces;
  // E x 2: the segments of polylines (OBJ `l`), such as the loops of a 2D cage.
  Faces edges;

  // The source, and where its positions stand.
  std::string bytes;
  std::vector<NumberSlot> slots;
};

// Formats by name, which is also the file extension; see builtin_formats.cc.
//   obj  v, f and l of any index form; all else is kept but not looked at.
//   off  with any prefix that keeps three coordinates (COFF, STNOFF, ...).
//   ply  ascii and binary of either byte order, any properties.
//   stl  ascii and binary. Corners at equal positions (0 equals -0) become one
//        vertex, in the order of their first occurrence.
// Any extent of bytes gives a mesh or InvalidArgument that names the line, in
// binary data the byte: BAD_MESH_FILE, UNKNOWN_MESH_FORMAT (lists the known
// ones), NOT_PLANAR. A file without vertices is refused. Takes time and memory
// in proportion to the bytes.
absl::StatusOr<MeshFile> ParseMesh(
    std::string bytes, absl::string_view format,
    FileDimension dimension = FileDimension::kAutomatic);

// The format goes by the extension. Besides what ParseMesh() refuses, with the
// path before the message: NotFound FILE_NOT_FOUND.
absl::StatusOr<MeshFile> ReadMeshFile(
    const std::string& path,
    FileDimension dimension = FileDimension::kAutomatic);

// The source of `file` with `positions` (N x 3) in place of its own. Numbers
// that did not change keep their bytes; others are written so that they read
// back as the same double, or float where the file's type is float. 2D keeps
// the file's z. STL's facet normals are computed anew. Refuses with
// InvalidArgument another number of rows (WRONG_LENGTH), positions that are not
// finite, and those a float cannot hold (COORDINATE_TOO_LARGE).
absl::StatusOr<std::string> WithPositions(const MeshFile& file,
                                          const Positions& positions);

// An OBJ file of bare geometry: faces of three corners as `f`, of two as `l`.
// Reads back bit by bit.
std::string ObjText(const Positions& positions, const Faces& faces);

}  // namespace deform
