// Object File Format: a header, counts, one vertex a line, one face a line.
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/files/mesh_format.h"
#include "core/files/text_scanner.h"

namespace deform {
namespace {

// The shortest lines there are: "0 0 0" and "0", with their ends.
constexpr int64_t kMinVertexBytes = 6;
constexpr int64_t kMinFaceBytes = 2;

class OffParser {
 public:
  explicit OffParser(absl::string_view bytes)
      : text_(bytes, {.comment = '#'}) {}

  absl::StatusOr<ParsedMesh> Parse() && {
    DEFORM_RETURN_IF_ERROR(ReadHeader());
    for (int64_t i = 0; i < vertices_; ++i) {
      DEFORM_RETURN_IF_ERROR(ToLineOf("vertex", i, vertices_));
      DEFORM_RETURN_IF_ERROR(text_.ReadPosition(first_word_, mesh_));
    }
    for (int64_t f = 0; f < faces_; ++f) {
      DEFORM_RETURN_IF_ERROR(ToLineOf("face", f, faces_));
      DEFORM_RETURN_IF_ERROR(ReadFace());
    }
    return std::move(mesh_);
  }

 private:
  // Prefixes tell what stands behind the three coordinates of a vertex (texture
  // coordinates, normals, colours); "4" and "n" would change their number.
  absl::Status ReadHeader() {
    absl::string_view word = text_.WordAcrossLines();
    if (absl::EndsWith(word, "OFF")) {
      const absl::string_view prefix = word.substr(0, word.size() - 3);
      if (prefix.find_first_not_of("STCN") != absl::string_view::npos) {
        return text_.Error(absl::StrCat("\"", absl::CHexEscape(word),
                                        "\": only files with three coordinates "
                                        "a vertex are read"));
      }
      word = text_.WordAcrossLines();
      if (word == "BINARY") {
        return text_.Error("binary OFF files are not read");
      }
    }
    DEFORM_ASSIGN_OR_RETURN(vertices_, Count(word, "vertices"));
    DEFORM_ASSIGN_OR_RETURN(faces_, Count(text_.WordAcrossLines(), "faces"));
    const auto fits = [&](int64_t count, int64_t min_bytes) {
      return count <= static_cast<int64_t>(text_.remaining()) / min_bytes + 1;
    };
    if (!fits(vertices_, kMinVertexBytes) || !fits(faces_, kMinFaceBytes)) {
      return text_.Error(absl::StrCat(vertices_, " vertices and ", faces_,
                                      " faces do not fit into the ",
                                      text_.remaining(), " bytes that follow"));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<int64_t> Count(absl::string_view word,
                                absl::string_view what) const {
    const auto count = ParseInteger(word);
    if (count && *count >= 0 && *count <= INT32_MAX) return *count;
    return text_.Error(absl::StrCat("\"", absl::CHexEscape(word.substr(0, 40)),
                                    "\" is no number of ", what));
  }

  // To the next line that says something; its first word is first_word_.
  absl::Status ToLineOf(absl::string_view what, int64_t number, int64_t count) {
    while (text_.NextLine()) {
      first_word_ = text_.Word();
      if (!first_word_.empty()) return absl::OkStatus();
    }
    return text_.Error(absl::StrCat("the file ends before ", what, " ", number,
                                    " of ", count));
  }

  absl::Status ReadFace() {
    DEFORM_ASSIGN_OR_RETURN(const int64_t count, Count(first_word_, "corners"));
    corners_.clear();
    for (int64_t k = 0; k < count; ++k) {
      const absl::string_view word = text_.Word();
      const auto index = ParseInteger(word);
      if (!index) {
        return text_.Error(
            absl::StrCat("corner ", k, " of ", count,
                         word.empty() ? " is missing" : " is no number"));
      }
      if (*index < 0 || *index >= vertices_) {
        return text_.Error(
            absl::StrCat("refers to vertex ", *index, " of ", vertices_));
      }
      corners_.push_back(static_cast<int32_t>(*index));
    }
    AddFace(mesh_, corners_);
    return absl::OkStatus();
  }

  TextScanner text_;
  ParsedMesh mesh_;
  int64_t vertices_ = 0;
  int64_t faces_ = 0;
  absl::string_view first_word_;
  std::vector<int32_t> corners_;
};

absl::StatusOr<ParsedMesh> ParseOff(absl::string_view bytes) {
  return OffParser(bytes).Parse();
}

}  // namespace

const MeshFormat& OffFormat() {
  static constexpr MeshFormat kFormat{"off", &ParseOff};
  return kFormat;
}

}  // namespace deform
