#include "core/files/mesh_file.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <span>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/files/number_bytes.h"
#include "core/files/polygons.h"
#include "core/mesh/mesh.h"
#include "core/mesh/triangle.h"

namespace deform {
namespace {

// Appends the shortest text that reads back as `value`.
template <typename T>
void AppendNumber(T value, std::string& text) {
  char buffer[40];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value).ptr;
  text.append(buffer, end);
}

template <typename T>
void AppendBinary(T value, bool big, std::string& bytes) {
  char buffer[sizeof(T)];
  StoreNumber(value, big, buffer);
  bytes.append(buffer, sizeof(T));
}

void AppendEncoded(double value, NumberEncoding encoding, std::string& bytes) {
  switch (encoding) {
    case NumberEncoding::kText:
      return AppendNumber(value, bytes);
    case NumberEncoding::kFloatText:
      return AppendNumber(static_cast<float>(value), bytes);
    case NumberEncoding::kFloatLittle:
    case NumberEncoding::kFloatBig:
      return AppendBinary(static_cast<float>(value),
                          encoding == NumberEncoding::kFloatBig, bytes);
    case NumberEncoding::kDoubleLittle:
    case NumberEncoding::kDoubleBig:
      return AppendBinary(value, encoding == NumberEncoding::kDoubleBig, bytes);
  }
}

bool IsFloat(NumberEncoding encoding) {
  return encoding == NumberEncoding::kFloatText ||
         encoding == NumberEncoding::kFloatLittle ||
         encoding == NumberEncoding::kFloatBig;
}

Faces EdgesOf(const std::vector<int32_t>& corners) {
  return Eigen::Map<const Faces>(
      corners.data(), static_cast<Eigen::Index>(corners.size() / 2), 2);
}

// Decides between 2D and 3D and, in 2D, forgets z.
absl::Status SetDimension(FileDimension asked, MeshFile& file) {
  const double z = file.positions(0, 2);
  int64_t off_plane = 0;
  while (off_plane < file.positions.rows() &&
         file.positions(off_plane, 2) == z) {
    ++off_plane;
  }
  const bool planar = off_plane == file.positions.rows();
  if (asked == FileDimension::k2d && !planar) {
    return InvalidInput(
        "NOT_PLANAR", "",
        absl::StrCat("a 2D file has one z for all vertices; vertex 0 has ", z,
                     ", vertex ", off_plane, " has ",
                     file.positions(off_plane, 2)));
  }
  file.dimension = planar && asked != FileDimension::k3d ? 2 : 3;
  if (file.dimension == 2) {
    file.positions.col(2).setZero();
    const auto vertices = static_cast<uint32_t>(file.positions.rows());
    std::erase_if(file.slots, [&](const NumberSlot& slot) {
      return slot.row < vertices && slot.axis == 2;
    });
  }
  return absl::OkStatus();
}

// The source with the numbers of its slots replaced.
class Rewriter {
 public:
  Rewriter(const MeshFile& file, const Positions& positions)
      : file_(file), positions_(positions) {}

  absl::StatusOr<std::string> Run() {
    std::string out;
    out.reserve(file_.bytes.size());
    size_t copied = 0;
    for (const NumberSlot& slot : file_.slots) {
      if (!Changed(slot)) continue;
      const double value = ValueOf(slot);
      if (IsFloat(slot.encoding) &&
          !(std::abs(value) <= std::numeric_limits<float>::max())) {
        return InvalidInput("COORDINATE_TOO_LARGE", "",
                            absl::StrCat("vertex ", slot.row,
                                         " has a coordinate beyond what the "
                                         "file's float32 can hold"));
      }
      out.append(file_.bytes, copied, slot.offset - copied);
      AppendEncoded(value, slot.encoding, out);
      copied = slot.offset + slot.length;
    }
    out.append(file_.bytes, copied);
    return out;
  }

 private:
  bool IsNormal(const NumberSlot& slot) const {
    return slot.row >= file_.positions.rows();
  }
  int64_t FacetOf(const NumberSlot& slot) const {
    return slot.row - file_.positions.rows();
  }

  bool Changed(const NumberSlot& slot) const {
    if (!IsNormal(slot)) {
      return positions_(slot.row, slot.axis) !=
             file_.positions(slot.row, slot.axis);
    }
    for (const int32_t corner : file_.faces.row(FacetOf(slot)).reshaped()) {
      if (positions_.row(corner) != file_.positions.row(corner)) return true;
    }
    return false;
  }

  double ValueOf(const NumberSlot& slot) const {
    if (!IsNormal(slot)) return positions_(slot.row, slot.axis);
    const auto face = file_.faces.row(FacetOf(slot));
    // A facet without area gets 0; adding 0 makes 0 of -0.
    const Vec3 normal =
        AreaVector(positions_.row(face[0]), positions_.row(face[1]),
                   positions_.row(face[2]))
            .stableNormalized();
    return normal[slot.axis] + 0.0;
  }

  const MeshFile& file_;
  const Positions& positions_;
};

absl::StatusOr<std::string> ReadBytes(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return MakeError(absl::StatusCode::kNotFound, "there is no such file",
                     {.reason = "FILE_NOT_FOUND"});
  }
  std::ifstream in(path, std::ios::binary);
  std::string bytes;
  bytes.resize(std::filesystem::file_size(path, error));
  if (!in || error || !in.read(bytes.data(), bytes.size())) {
    return MakeError(absl::StatusCode::kNotFound, "cannot be read",
                     {.reason = "FILE_NOT_FOUND"});
  }
  return bytes;
}

}  // namespace

void AddFace(ParsedMesh& mesh, std::span<const int32_t> corners) {
  if (corners.size() == 2) {
    mesh.edges.insert(mesh.edges.end(), corners.begin(), corners.end());
  }
  if (corners.size() < 3) return;
  mesh.polygons.corners.insert(mesh.polygons.corners.end(), corners.begin(),
                               corners.end());
  mesh.polygons.sizes.push_back(static_cast<int32_t>(corners.size()));
}

absl::StatusOr<MeshFile> ParseMesh(std::string bytes, absl::string_view format,
                                   FileDimension dimension) {
  DEFORM_ASSIGN_OR_RETURN(const MeshFormat* const parser,
                          FindMeshFormat(format));
  DEFORM_ASSIGN_OR_RETURN(ParsedMesh parsed, parser->parse(bytes));
  if (parsed.coordinates.empty()) {
    return InvalidInput("BAD_MESH_FILE", "", "the file has no vertices");
  }
  MeshFile file;
  file.format = std::string(parser->name);
  file.positions = Eigen::Map<const Positions>(
      parsed.coordinates.data(),
      static_cast<Eigen::Index>(parsed.coordinates.size() / 3), 3);
  DEFORM_RETURN_IF_ERROR(CheckPositions(file.positions, "vertex", ""));
  DEFORM_ASSIGN_OR_RETURN(file.faces,
                          Triangulate(parsed.polygons, file.positions));
  file.edges = EdgesOf(parsed.edges);
  file.slots = std::move(parsed.slots);
  file.bytes = std::move(bytes);
  DEFORM_RETURN_IF_ERROR(SetDimension(dimension, file));
  return file;
}

absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path,
                                      FileDimension dimension) {
  const std::string extension =
      std::filesystem::path(path).extension().string();
  const auto read = [&]() -> absl::StatusOr<MeshFile> {
    const std::string name = extension.empty() ? "" : extension.substr(1);
    DEFORM_RETURN_IF_ERROR(FindMeshFormat(name).status());
    DEFORM_ASSIGN_OR_RETURN(std::string bytes, ReadBytes(path));
    return ParseMesh(std::move(bytes), name, dimension);
  };
  absl::StatusOr<MeshFile> file = read();
  if (!file.ok()) return Annotate(file.status(), absl::StrCat(path, ": "));
  return file;
}

absl::StatusOr<std::string> WithPositions(const MeshFile& file,
                                          const Positions& positions) {
  if (positions.rows() != file.positions.rows()) {
    return InvalidInput("WRONG_LENGTH", "",
                        absl::StrCat("the file has ", file.positions.rows(),
                                     " vertices, not ", positions.rows()));
  }
  DEFORM_RETURN_IF_ERROR(CheckPositions(positions, "vertex", ""));
  return Rewriter(file, positions).Run();
}

std::string ObjText(const Positions& positions, const Faces& faces) {
  std::string text;
  for (const auto& row : positions.rowwise()) {
    text += 'v';
    for (int axis = 0; axis < 3; ++axis) {
      text += ' ';
      AppendNumber(row[axis], text);
    }
    text += '\n';
  }
  for (const auto& face : faces.rowwise()) {
    text += face.size() == 2 ? 'l' : 'f';
    for (const int32_t corner : face) absl::StrAppend(&text, " ", corner + 1);
    text += '\n';
  }
  return text;
}

}  // namespace deform
