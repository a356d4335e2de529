// Colours that stand for numbers.
#pragma once

#include <string>
#include <vector>

#include "client/pictures/canvas.h"

namespace deform {

enum class ColorMap {
  // From dark violet to yellow, evenly to the eye; also without colour.
  kSequential,
  // From blue over white to red, for values on both sides of a middle.
  kDiverging,
};

// The colour of `place`, from 0 to 1; what is beyond counts as the end.
Light ColorAt(ColorMap map, double place);

// What the colours of a picture mean.
struct ColorScale {
  ColorMap map = ColorMap::kSequential;
  double low = 0;
  double high = 1;           // > low
  bool logarithmic = false;  // Needs low > 0.
  std::string title;

  // Where a value lies between the ends, from 0 to 1; NaN stays NaN.
  double PlaceOf(double value) const;
};

// Round numbers within [low, high], about `count`: 1, 2 or 5 times a power of
// ten; on a logarithmic scale powers of ten, and 2 and 5 times these if they
// are few.
std::vector<double> RoundTicks(double low, double high, bool logarithmic,
                               int count);

// "0.25", "1e-6", "3000".
std::string NumberText(double value);

}  // namespace deform
