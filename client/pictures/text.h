// Words in pictures.
#pragma once

#include "absl/strings/string_view.h"
#include "client/pictures/canvas.h"

namespace deform {

enum class Align { kLeft, kCenter, kRight };

// Height of a capital letter of a text of size 1, pixels; lines are kTextLine
// apart.
inline constexpr double kTextHeight = 12;
inline constexpr double kTextLine = 22;

// Width of the widest line, pixels.
double TextWidth(absl::string_view text, double size);

// Writes lines of printable ASCII into the line layer of the canvas, whose
// FlushLines() gives them their colour. (x, y) is the upper end of the first,
// at its left, middle or right.
void DrawText(absl::string_view text, double x, double y, double size,
              Align align, Canvas& canvas);

}  // namespace deform
