// A finished picture.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace deform {

// sRGB, 0 to 255.
struct Color {
  uint8_t r = 0;
  uint8_t g = 0;
  uint8_t b = 0;
  bool operator==(const Color&) const = default;
};

struct Image {
  int width = 0;
  int height = 0;
  std::vector<Color> pixels;  // Rows from the top.

  const Color& at(int x, int y) const { return pixels[y * width + x]; }
  Color& at(int x, int y) { return pixels[y * width + x]; }
};

// The bytes of a PNG file. `image` is not empty.
std::string EncodePng(const Image& image);

// Writes a PNG file. An error names the path and what the system said.
absl::Status WritePng(const Image& image, const std::string& path);

}  // namespace deform
