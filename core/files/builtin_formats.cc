#include <array>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/files/mesh_format.h"

// To add a format: write formats/<name>.cc, then add one line here.
#define DEFORM_MESH_FORMATS(X) \
  X(Obj)                       \
  X(Off)                       \
  X(Ply)                       \
  X(Stl)

namespace deform {

#define DEFORM_DECLARE(name) const MeshFormat& name##Format();
DEFORM_MESH_FORMATS(DEFORM_DECLARE)
#undef DEFORM_DECLARE

std::span<const MeshFormat* const> AllMeshFormats() {
#define DEFORM_LIST(name) &name##Format(),
  static const auto formats =
      std::to_array<const MeshFormat*>({DEFORM_MESH_FORMATS(DEFORM_LIST)});
#undef DEFORM_LIST
  return formats;
}

absl::StatusOr<const MeshFormat*> FindMeshFormat(absl::string_view name) {
  std::string known;
  for (const MeshFormat* format : AllMeshFormats()) {
    if (absl::EqualsIgnoreCase(format->name, name)) return format;
    absl::StrAppend(&known, known.empty() ? "" : ", ", format->name);
  }
  return InvalidInput("UNKNOWN_MESH_FORMAT", "",
                      absl::StrCat("\"", absl::CHexEscape(name),
                                   "\" is not a mesh format: ", known, " are"));
}

absl::Status BadLine(int64_t line, absl::string_view what) {
  return InvalidInput("BAD_MESH_FILE", "",
                      absl::StrCat("line ", line, ": ", what));
}

absl::Status BadByte(uint64_t offset, absl::string_view what) {
  return InvalidInput("BAD_MESH_FILE", "",
                      absl::StrCat("byte ", offset, ": ", what));
}

}  // namespace deform
