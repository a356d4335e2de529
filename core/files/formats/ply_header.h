// What a PLY file announces.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace deform {

enum class PlyType {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kFloat32,
  kFloat64
};

// Bytes of a value in a binary file.
int PlySize(PlyType type);

struct PlyProperty {
  std::string name;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  // Of lists.
  PlyType type = PlyType::kFloat32;
};

struct PlyElement {
  std::string name;
  int64_t count = 0;
  std::vector<PlyProperty> properties;
  // Fewest bytes that one instance takes in the file.
  int64_t MinBytes(bool ascii) const;
  // Whether any property is a list, so that instances differ in length.
  bool has_lists() const;
};

enum class PlyEncoding { kAscii, kLittle, kBig };

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  // Where the data begin, and how many lines stand before them.
  size_t end = 0;
  int64_t lines = 0;
};

// Refuses, naming the line, headers that are none, end too early, or announce
// what cannot stand in `bytes`.
absl::StatusOr<PlyHeader> ParsePlyHeader(absl::string_view bytes);

}  // namespace deform
