#include "client/pictures/text.h"

#include <algorithm>

#include "absl/strings/str_split.h"
#include "client/pictures/font.h"

namespace deform {
namespace {

// Pixels of the picture for one of the font.
constexpr double kDot = kTextHeight / (kFontHeight - 1);

double LineWidth(absl::string_view line, double size) {
  return std::max(0.0, kFontAdvance * static_cast<double>(line.size()) - 2) *
         kDot * size;
}

}  // namespace

double TextWidth(absl::string_view text, double size) {
  double width = 0;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    width = std::max(width, LineWidth(line, size));
  }
  return width;
}

void DrawText(absl::string_view text, double x, double y, double size,
              Align align, Canvas& canvas) {
  const double dot = kDot * size;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const double width = LineWidth(line, size);
    const double left = align == Align::kLeft     ? x
                        : align == Align::kCenter ? x - 0.5 * width
                                                  : x - width;
    for (const Stroke& stroke : TextStrokes(line)) {
      canvas.Line({left + dot * stroke.x0, y + dot * stroke.y0, 1},
                  {left + dot * stroke.x1, y + dot * stroke.y1, 1}, 1.05 * dot,
                  1, 1, 0);
    }
    y += kTextLine * size;
  }
}

}  // namespace deform
