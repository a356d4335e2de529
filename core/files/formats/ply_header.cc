#include "core/files/formats/ply_header.h"

#include <algorithm>
#include <optional>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/files/text_scanner.h"

namespace deform {
namespace {

std::optional<PlyType> TypeNamed(absl::string_view name) {
  struct Name {
    absl::string_view old_name;
    absl::string_view sized_name;
    PlyType type;
  };
  static constexpr Name kNames[] = {{"char", "int8", PlyType::kInt8},
                                    {"uchar", "uint8", PlyType::kUint8},
                                    {"short", "int16", PlyType::kInt16},
                                    {"ushort", "uint16", PlyType::kUint16},
                                    {"int", "int32", PlyType::kInt32},
                                    {"uint", "uint32", PlyType::kUint32},
                                    {"float", "float32", PlyType::kFloat32},
                                    {"double", "float64", PlyType::kFloat64}};
  for (const Name& entry : kNames) {
    if (name == entry.old_name || name == entry.sized_name) return entry.type;
  }
  return std::nullopt;
}

class HeaderParser {
 public:
  explicit HeaderParser(absl::string_view bytes)
      : bytes_(bytes), text_(bytes, {}) {}

  absl::StatusOr<PlyHeader> Parse() && {
    if (!text_.NextLine() || text_.Word() != "ply") {
      return BadLine(1, "a PLY file begins with the line \"ply\"");
    }
    bool has_format = false;
    while (text_.NextLine()) {
      const absl::string_view keyword = text_.Word();
      if (keyword == "end_header") {
        if (!has_format) return text_.Error("the header names no format");
        header_.lines = text_.line();
        text_.NextLine();
        header_.end = bytes_.size() - text_.remaining();
        return std::move(header_);
      }
      if (keyword == "format") {
        has_format = true;
        DEFORM_RETURN_IF_ERROR(ReadFormat());
      } else if (keyword == "element") {
        DEFORM_RETURN_IF_ERROR(ReadElement());
      } else if (keyword == "property") {
        DEFORM_RETURN_IF_ERROR(ReadProperty());
      } else if (!keyword.empty() && keyword != "comment" &&
                 keyword != "obj_info") {
        return text_.Error(absl::StrCat(
            "\"", absl::CHexEscape(keyword.substr(0, 40)), "\" in the header"));
      }
    }
    return text_.Error("the file ends before end_header");
  }

 private:
  absl::Status ReadFormat() {
    const absl::string_view name = text_.Word();
    if (name == "ascii") {
      header_.encoding = PlyEncoding::kAscii;
    } else if (name == "binary_little_endian") {
      header_.encoding = PlyEncoding::kLittle;
    } else if (name == "binary_big_endian") {
      header_.encoding = PlyEncoding::kBig;
    } else {
      return text_.Error(
          "the format is ascii, binary_little_endian or binary_big_endian");
    }
    return absl::OkStatus();
  }

  absl::Status ReadElement() {
    PlyElement element;
    element.name = std::string(text_.Word());
    const auto count = ParseInteger(text_.Word());
    if (element.name.empty() || !count || *count < 0) {
      return text_.Error("an element needs a name and a count");
    }
    element.count = *count;
    header_.elements.push_back(std::move(element));
    return absl::OkStatus();
  }

  absl::Status ReadProperty() {
    if (header_.elements.empty()) {
      return text_.Error("a property stands before the first element");
    }
    PlyProperty property;
    absl::string_view type = text_.Word();
    if (type == "list") {
      property.is_list = true;
      DEFORM_ASSIGN_OR_RETURN(property.count_type, Type(text_.Word()));
      type = text_.Word();
    }
    DEFORM_ASSIGN_OR_RETURN(property.type, Type(type));
    property.name = std::string(text_.Word());
    if (property.name.empty()) return text_.Error("a property needs a name");
    header_.elements.back().properties.push_back(std::move(property));
    return absl::OkStatus();
  }

  absl::StatusOr<PlyType> Type(absl::string_view name) const {
    if (const auto type = TypeNamed(name)) return *type;
    return text_.Error(absl::StrCat("\"", absl::CHexEscape(name.substr(0, 40)),
                                    "\" is no property type"));
  }

  absl::string_view bytes_;
  TextScanner text_;
  PlyHeader header_;
};

}  // namespace

int PlySize(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

int64_t PlyElement::MinBytes(bool ascii) const {
  // A digit and a blank.
  if (ascii) return 2 * static_cast<int64_t>(properties.size());
  int64_t sum = 0;
  for (const PlyProperty& property : properties) {
    sum += PlySize(property.is_list ? property.count_type : property.type);
  }
  return sum;
}

bool PlyElement::has_lists() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& p) { return p.is_list; });
}

absl::StatusOr<PlyHeader> ParsePlyHeader(absl::string_view bytes) {
  DEFORM_ASSIGN_OR_RETURN(PlyHeader header, HeaderParser(bytes).Parse());
  const bool ascii = header.encoding == PlyEncoding::kAscii;
  // The last value of a text needs no blank after it.
  int64_t left = static_cast<int64_t>(bytes.size() - header.end) + ascii;
  for (const PlyElement& element : header.elements) {
    const int64_t each = element.MinBytes(ascii);
    if (each == 0) continue;
    if (element.count > left / each) {
      return BadByte(header.end,
                     absl::StrCat(element.count, " of element ", element.name,
                                  " do not fit into the file"));
    }
    left -= element.count * each;
  }
  return header;
}

}  // namespace deform
