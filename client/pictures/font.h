// Captions.
#pragma once

#include <vector>

#include "absl/strings/string_view.h"

namespace deform {

// A stroke from (x0, y0) to (x1, y1) in font pixels: y downwards, capital
// letters 0 to 6, descenders to 8. A dot has no length.
struct Stroke {
  double x0, y0, x1, y1;
};

// From one letter to the next, in font pixels.
inline constexpr double kFontAdvance = 6;
inline constexpr double kFontHeight = 7;

// The strokes of a line of printable ASCII; anything else becomes '?'. Letters
// are 5 x 7 bitmaps whose neighbouring dots are joined, so that they can be
// drawn smoothly at any size.
std::vector<Stroke> TextStrokes(absl::string_view text);

}  // namespace deform
