// Polygon File Format: ascii and binary of either byte order. The header is
// read in ply_header.cc, here the elements after it: `vertex` with x, y and z,
// and `face` with a list of vertex_indices (or vertex_index). All else is
// stepped over.
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/files/formats/ply_header.h"
#include "core/files/mesh_format.h"
#include "core/files/number_bytes.h"
#include "core/files/text_scanner.h"

namespace deform {
namespace {

struct PlyValue {
  double value = 0;
  uint64_t offset = 0;
  uint16_t length = 0;
};

double LoadValue(PlyType type, const char* at, bool big) {
  switch (type) {
    case PlyType::kInt8:
      return LoadNumber<int8_t>(at, big);
    case PlyType::kUint8:
      return LoadNumber<uint8_t>(at, big);
    case PlyType::kInt16:
      return LoadNumber<int16_t>(at, big);
    case PlyType::kUint16:
      return LoadNumber<uint16_t>(at, big);
    case PlyType::kInt32:
      return LoadNumber<int32_t>(at, big);
    case PlyType::kUint32:
      return LoadNumber<uint32_t>(at, big);
    case PlyType::kFloat32:
      return LoadNumber<float>(at, big);
    case PlyType::kFloat64:
      return LoadNumber<double>(at, big);
  }
  return 0;
}

// The values after the header, one after the other.
class PlyData {
 public:
  PlyData(absl::string_view bytes, const PlyHeader& header)
      : bytes_(bytes),
        encoding_(header.encoding),
        at_(header.end),
        text_(bytes, {}, header.end, header.lines) {}

  PlyEncoding encoding() const { return encoding_; }

  absl::StatusOr<PlyValue> Read(PlyType type) {
    if (encoding_ == PlyEncoding::kAscii) {
      const absl::string_view word = text_.WordAcrossLines();
      DEFORM_ASSIGN_OR_RETURN(const double value, text_.Number(word, "value"));
      return PlyValue{value, text_.OffsetOf(word),
                      static_cast<uint16_t>(word.size())};
    }
    const int size = PlySize(type);
    const uint64_t offset = at_;
    DEFORM_RETURN_IF_ERROR(StepOver(size));
    return PlyValue{
        LoadValue(type, bytes_.data() + offset, encoding_ == PlyEncoding::kBig),
        offset, static_cast<uint16_t>(size)};
  }

  // The number of items of a list.
  absl::StatusOr<int64_t> ReadCount(PlyType type) {
    DEFORM_ASSIGN_OR_RETURN(const PlyValue count, Read(type));
    if (!(count.value >= 0 && count.value <= INT32_MAX &&
          count.value == std::floor(count.value))) {
      return Error(absl::StrCat("a list cannot have ", count.value, " items"));
    }
    return static_cast<int64_t>(count.value);
  }

  absl::Status SkipItems(int64_t count, PlyType type) {
    if (encoding_ != PlyEncoding::kAscii) {
      return StepOver(count * PlySize(type));
    }
    for (int64_t i = 0; i < count; ++i) {
      if (text_.WordAcrossLines().empty()) return Error("the file ends early");
    }
    return absl::OkStatus();
  }

  // Where the last value stands: its line or its byte.
  int64_t place() const {
    return encoding_ == PlyEncoding::kAscii ? text_.line()
                                            : static_cast<int64_t>(at_);
  }
  absl::Status ErrorAt(int64_t place, absl::string_view what) const {
    return encoding_ == PlyEncoding::kAscii ? BadLine(place, what)
                                            : BadByte(place, what);
  }
  absl::Status Error(absl::string_view what) const {
    return ErrorAt(place(), what);
  }

 private:
  absl::Status StepOver(uint64_t size) {
    if (size > bytes_.size() - at_) return Error("the file ends early");
    at_ += size;
    return absl::OkStatus();
  }

  absl::string_view bytes_;
  PlyEncoding encoding_;
  size_t at_;  // Of binary data.
  TextScanner text_;
};

NumberEncoding SlotEncoding(PlyEncoding encoding, PlyType type) {
  const bool is_float = type == PlyType::kFloat32;
  switch (encoding) {
    case PlyEncoding::kAscii:
      return is_float ? NumberEncoding::kFloatText : NumberEncoding::kText;
    case PlyEncoding::kLittle:
      return is_float ? NumberEncoding::kFloatLittle
                      : NumberEncoding::kDoubleLittle;
    case PlyEncoding::kBig:
      break;
  }
  return is_float ? NumberEncoding::kFloatBig : NumberEncoding::kDoubleBig;
}

class PlyParser {
 public:
  PlyParser(absl::string_view bytes, PlyHeader header)
      : header_(std::move(header)), data_(bytes, header_) {}

  absl::StatusOr<ParsedMesh> Parse() && {
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;
      if (element.name == "vertex") {
        DEFORM_RETURN_IF_ERROR(CheckCoordinates(element));
      }
      for (int64_t i = 0; i < element.count; ++i) {
        DEFORM_RETURN_IF_ERROR(element.name == "vertex" ? ReadVertex(element)
                               : element.name == "face" ? ReadFace(element)
                                                        : Skip(element));
      }
    }
    const int64_t vertices = mesh_.coordinates.size() / 3;
    if (largest_.index >= vertices) {
      return data_.ErrorAt(
          largest_.place,
          absl::StrCat("refers to vertex ", largest_.index, " of ", vertices));
    }
    return std::move(mesh_);
  }

 private:
  static int AxisOf(const PlyProperty& property) {
    if (property.name.size() != 1) return -1;
    const size_t axis = absl::string_view("xyz").find(property.name[0]);
    return axis == absl::string_view::npos ? -1 : static_cast<int>(axis);
  }

  absl::Status CheckCoordinates(const PlyElement& element) const {
    int found[3] = {0, 0, 0};
    for (const PlyProperty& property : element.properties) {
      const int axis = AxisOf(property);
      if (axis < 0) continue;
      ++found[axis];
      if (property.is_list || (property.type != PlyType::kFloat32 &&
                               property.type != PlyType::kFloat64)) {
        return BadLine(header_.lines,
                       absl::StrCat("coordinate ", property.name,
                                    " must be of type float or double"));
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (found[axis] == 1) continue;
      return BadLine(
          header_.lines,
          absl::StrCat("element vertex has ", found[axis], " properties ",
                       std::string(1, "xyz"[axis]), ", not one"));
    }
    return absl::OkStatus();
  }

  absl::Status ReadVertex(const PlyElement& element) {
    const size_t base = mesh_.coordinates.size();
    const auto row = static_cast<uint32_t>(base / 3);
    mesh_.coordinates.resize(base + 3);
    for (const PlyProperty& property : element.properties) {
      const int axis = AxisOf(property);
      if (axis < 0) {
        DEFORM_RETURN_IF_ERROR(SkipProperty(property));
        continue;
      }
      DEFORM_ASSIGN_OR_RETURN(const PlyValue value, data_.Read(property.type));
      if (!std::isfinite(value.value)) {
        return data_.Error(absl::StrCat("coordinate ", property.name,
                                        " of vertex ", row, " is not finite"));
      }
      mesh_.coordinates[base + axis] = value.value;
      mesh_.slots.push_back(
          {.offset = value.offset,
           .row = row,
           .length = value.length,
           .axis = static_cast<uint8_t>(axis),
           .encoding = SlotEncoding(data_.encoding(), property.type)});
    }
    return absl::OkStatus();
  }

  absl::Status ReadFace(const PlyElement& element) {
    for (const PlyProperty& property : element.properties) {
      const bool names_corners =
          property.is_list && (property.name == "vertex_indices" ||
                               property.name == "vertex_index");
      if (!names_corners) {
        DEFORM_RETURN_IF_ERROR(SkipProperty(property));
        continue;
      }
      DEFORM_ASSIGN_OR_RETURN(const int64_t count,
                              data_.ReadCount(property.count_type));
      corners_.clear();
      for (int64_t k = 0; k < count; ++k) {
        DEFORM_ASSIGN_OR_RETURN(const PlyValue corner,
                                data_.Read(property.type));
        if (!(corner.value >= 0 && corner.value <= INT32_MAX &&
              corner.value == std::floor(corner.value))) {
          return data_.Error(absl::StrCat("there is no vertex ", corner.value));
        }
        corners_.push_back(static_cast<int32_t>(corner.value));
        largest_.See(corners_.back(), data_.place());
      }
      AddFace(mesh_, corners_);
    }
    return absl::OkStatus();
  }

  absl::Status SkipProperty(const PlyProperty& property) {
    int64_t count = 1;
    if (property.is_list) {
      DEFORM_ASSIGN_OR_RETURN(count, data_.ReadCount(property.count_type));
    }
    return data_.SkipItems(count, property.type);
  }

  absl::Status Skip(const PlyElement& element) {
    for (const PlyProperty& property : element.properties) {
      DEFORM_RETURN_IF_ERROR(SkipProperty(property));
    }
    return absl::OkStatus();
  }

  PlyHeader header_;
  PlyData data_;
  ParsedMesh mesh_;
  LargestIndex largest_;
  std::vector<int32_t> corners_;
};

absl::StatusOr<ParsedMesh> ParsePly(absl::string_view bytes) {
  DEFORM_ASSIGN_OR_RETURN(PlyHeader header, ParsePlyHeader(bytes));
  return PlyParser(bytes, std::move(header)).Parse();
}

}  // namespace

const MeshFormat& PlyFormat() {
  static constexpr MeshFormat kFormat{"ply", &ParsePly};
  return kFormat;
}

}  // namespace deform
