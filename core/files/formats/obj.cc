// Wavefront OBJ: `v`, `f` and `l`, whose corners count from 1, or from the last
// vertex backwards where negative; all else is for others to read.
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/files/mesh_format.h"
#include "core/files/text_scanner.h"

namespace deform {
namespace {

class ObjParser {
 public:
  explicit ObjParser(absl::string_view bytes)
      : text_(bytes, {.comment = '#', .continues_lines = true}) {}

  absl::StatusOr<ParsedMesh> Parse() && {
    while (text_.NextLine()) {
      const absl::string_view keyword = text_.Word();
      if (keyword == "v") {
        DEFORM_RETURN_IF_ERROR(text_.ReadPosition(text_.Word(), mesh_));
      } else if (keyword == "f") {
        DEFORM_RETURN_IF_ERROR(ReadFace());
      } else if (keyword == "l") {
        DEFORM_RETURN_IF_ERROR(ReadPolyline());
      }
    }
    if (largest_.index >= vertex_count()) {
      return BadLine(largest_.place,
                     absl::StrCat("refers to vertex ", largest_.index + 1,
                                  " of ", vertex_count()));
    }
    return std::move(mesh_);
  }

 private:
  int64_t vertex_count() const { return mesh_.coordinates.size() / 3; }

  // Corners of this line into corners_, from 0.
  absl::Status ReadCorners() {
    corners_.clear();
    for (absl::string_view word = text_.Word(); !word.empty();
         word = text_.Word()) {
      const auto index = ParseInteger(word.substr(0, word.find('/')));
      if (!index || *index == 0) {
        return text_.Error(absl::StrCat("\"", absl::CHexEscape(word),
                                        "\" refers to no vertex: they count "
                                        "from 1, or from -1 backwards"));
      }
      const int64_t corner = *index > 0 ? *index - 1 : vertex_count() + *index;
      if (corner < 0 || corner > INT32_MAX) {
        return text_.Error(absl::StrCat("refers to vertex ", *index, "; ",
                                        vertex_count(), " stand before it"));
      }
      largest_.See(corner, text_.line());
      corners_.push_back(static_cast<int32_t>(corner));
    }
    return absl::OkStatus();
  }

  absl::Status ReadFace() {
    DEFORM_RETURN_IF_ERROR(ReadCorners());
    AddFace(mesh_, corners_);
    return absl::OkStatus();
  }

  absl::Status ReadPolyline() {
    DEFORM_RETURN_IF_ERROR(ReadCorners());
    for (size_t i = 1; i < corners_.size(); ++i) {
      mesh_.edges.insert(mesh_.edges.end(), {corners_[i - 1], corners_[i]});
    }
    return absl::OkStatus();
  }

  TextScanner text_;
  ParsedMesh mesh_;
  LargestIndex largest_;
  std::vector<int32_t> corners_;
};

absl::StatusOr<ParsedMesh> ParseObj(absl::string_view bytes) {
  return ObjParser(bytes).Parse();
}

}  // namespace

const MeshFormat& ObjFormat() {
  static constexpr MeshFormat kFormat{"obj", &ParseObj};
  return kFormat;
}

}  // namespace deform
