// Stereolithography: bare triangles, ascii and binary. Corners at equal
// positions are welded into one vertex, in order of first occurrence.
#include <array>
#include <cmath>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/hash/hash.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/files/mesh_format.h"
#include "core/files/number_bytes.h"
#include "core/files/text_scanner.h"

namespace deform {
namespace {

constexpr size_t kHeaderBytes = 84;
constexpr size_t kFacetBytes = 50;

// Twelve numbers of one facet in the order of the file: normal, three corners.
using FacetSlots = std::array<NumberSlot, 12>;

// Collects facets; corners become vertices as they are seen.
class Welder {
 public:
  void AddFacet(const std::array<double, 9>& corners, const FacetSlots& slots) {
    facet_slots_.push_back(mesh_.slots.size());
    mesh_.slots.insert(mesh_.slots.end(), slots.begin(), slots.end());
    std::array<int32_t, 3> face;
    for (size_t k = 0; k < 3; ++k) {
      face[k] =
          Vertex({corners[3 * k], corners[3 * k + 1], corners[3 * k + 2]});
      for (size_t axis = 0; axis < 3; ++axis) {
        mesh_.slots[facet_slots_.back() + 3 + 3 * k + axis].row = face[k];
      }
    }
    AddFace(mesh_, face);
  }

  // Rows of normals come after those of all vertices.
  ParsedMesh Finish() && {
    const size_t vertices = mesh_.coordinates.size() / 3;
    for (size_t f = 0; f < facet_slots_.size(); ++f) {
      for (size_t axis = 0; axis < 3; ++axis) {
        mesh_.slots[facet_slots_[f] + axis].row =
            static_cast<uint32_t>(vertices + f);
      }
    }
    return std::move(mesh_);
  }

 private:
  using Key = std::array<double, 3>;

  int32_t Vertex(Key position) {
    for (double& x : position) x += 0.0;  // -0 becomes 0.
    const auto [entry, is_new] =
        vertices_.try_emplace(position, static_cast<int32_t>(vertices_.size()));
    if (is_new) {
      mesh_.coordinates.insert(mesh_.coordinates.end(), position.begin(),
                               position.end());
    }
    return entry->second;
  }

  ParsedMesh mesh_;
  std::vector<size_t> facet_slots_;  // First slot of each facet.
  std::unordered_map<Key, int32_t, absl::Hash<Key>> vertices_;
};

absl::StatusOr<ParsedMesh> ParseBinary(absl::string_view bytes) {
  if (bytes.size() < kHeaderBytes) {
    return BadByte(bytes.size(),
                   "neither ascii STL (it would begin with \"solid\") nor "
                   "binary STL (its header takes 84 bytes)");
  }
  const auto count = LoadNumber<uint32_t>(bytes.data() + 80, false);
  const size_t room = (bytes.size() - kHeaderBytes) / kFacetBytes;
  if (count > room) {
    return BadByte(80, absl::StrCat("the file announces ", count,
                                    " triangles and has room for ", room));
  }
  Welder welder;
  for (uint32_t f = 0; f < count; ++f) {
    const uint64_t begin = kHeaderBytes + uint64_t{f} * kFacetBytes;
    std::array<double, 9> corners;
    FacetSlots slots;
    for (size_t i = 0; i < slots.size(); ++i) {
      const uint64_t offset = begin + 4 * i;
      slots[i] = {.offset = offset,
                  .length = 4,
                  .axis = static_cast<uint8_t>(i % 3),
                  .encoding = NumberEncoding::kFloatLittle};
      if (i < 3) continue;
      corners[i - 3] = LoadNumber<float>(bytes.data() + offset, false);
      if (!std::isfinite(corners[i - 3])) {
        return BadByte(offset, absl::StrCat("a coordinate of triangle ", f,
                                            " is not finite"));
      }
    }
    welder.AddFacet(corners, slots);
  }
  return std::move(welder).Finish();
}

class AsciiParser {
 public:
  explicit AsciiParser(absl::string_view bytes) : text_(bytes, {}) {}

  absl::StatusOr<ParsedMesh> Parse() && {
    absl::string_view word = text_.WordAcrossLines();
    while (!word.empty()) {
      if (absl::EqualsIgnoreCase(word, "facet")) {
        DEFORM_RETURN_IF_ERROR(ReadFacet());
      } else if (absl::EqualsIgnoreCase(word, "solid") ||
                 absl::EqualsIgnoreCase(word, "endsolid")) {
        text_.NextLine();  // The rest of the line is a name.
      } else {
        return Unexpected(word, "facet");
      }
      word = text_.WordAcrossLines();
    }
    return std::move(welder_).Finish();
  }

 private:
  absl::Status Unexpected(absl::string_view word, absl::string_view expected) {
    return text_.Error(
        word.empty()
            ? absl::StrCat("the file ends where \"", expected, "\" should be")
            : absl::StrCat("\"", absl::CHexEscape(word.substr(0, 40)),
                           "\" stands where \"", expected, "\" should be"));
  }

  absl::Status Expect(absl::string_view keyword) {
    const absl::string_view word = text_.WordAcrossLines();
    if (absl::EqualsIgnoreCase(word, keyword)) return absl::OkStatus();
    return Unexpected(word, keyword);
  }

  // The next word as number i of a facet.
  absl::StatusOr<absl::string_view> ReadSlot(size_t i, FacetSlots& slots) {
    const absl::string_view word = text_.WordAcrossLines();
    if (word.empty() || word.size() > UINT16_MAX) {
      return text_.Error("a number is missing");
    }
    slots[i] = {.offset = text_.OffsetOf(word),
                .length = static_cast<uint16_t>(word.size()),
                .axis = static_cast<uint8_t>(i % 3),
                .encoding = NumberEncoding::kText};
    return word;
  }

  absl::Status ReadFacet() {
    FacetSlots slots;
    std::array<double, 9> corners;
    DEFORM_RETURN_IF_ERROR(Expect("normal"));
    for (size_t i = 0; i < 3; ++i) {
      // Writers put anything here, such as nan; it is computed anew.
      DEFORM_RETURN_IF_ERROR(ReadSlot(i, slots).status());
    }
    DEFORM_RETURN_IF_ERROR(Expect("outer"));
    DEFORM_RETURN_IF_ERROR(Expect("loop"));
    for (size_t i = 3; i < slots.size(); ++i) {
      if (i % 3 == 0) DEFORM_RETURN_IF_ERROR(Expect("vertex"));
      DEFORM_ASSIGN_OR_RETURN(const absl::string_view word, ReadSlot(i, slots));
      DEFORM_ASSIGN_OR_RETURN(corners[i - 3], text_.Number(word, "coordinate"));
    }
    DEFORM_RETURN_IF_ERROR(Expect("endloop"));
    DEFORM_RETURN_IF_ERROR(Expect("endfacet"));
    welder_.AddFacet(corners, slots);
    return absl::OkStatus();
  }

  TextScanner text_;
  Welder welder_;
};

// Some binary files begin with "solid" too, but their length gives them away.
bool IsBinary(absl::string_view bytes) {
  if (!absl::StartsWithIgnoreCase(absl::StripLeadingAsciiWhitespace(bytes),
                                  "solid")) {
    return true;
  }
  return bytes.size() >= kHeaderBytes &&
         bytes.size() ==
             kHeaderBytes + kFacetBytes * uint64_t{LoadNumber<uint32_t>(
                                              bytes.data() + 80, false)};
}

absl::StatusOr<ParsedMesh> ParseStl(absl::string_view bytes) {
  return IsBinary(bytes) ? ParseBinary(bytes) : AsciiParser(bytes).Parse();
}

}  // namespace

const MeshFormat& StlFormat() {
  static constexpr MeshFormat kFormat{"stl", &ParseStl};
  return kFormat;
}

}  // namespace deform
