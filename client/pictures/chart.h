// Curves and bars over axes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/pictures/color_scale.h"
#include "client/pictures/image.h"

namespace deform {

struct Axis {
  std::string title;
  bool logarithmic = false;  // Needs low > 0.
  double low = 0;
  double high = 1;  // > low
  // Instead of numbers: one word for each unit from 0 on.
  std::vector<std::string> labels = {};
};

struct Curve {
  std::string name;  // In the legend; may be empty.
  Light color = Light::Zero();
  bool dots = false;  // Also mark the points themselves.
  // Points off the axes are cut off; NaN leaves a gap.
  std::vector<double> x, y;
};

struct Bar {
  double from, to;  // On the x axis.
  double height;
  Light color;
};

struct Chart {
  std::string title;
  Axis x, y;
  std::vector<Bar> bars;
  std::vector<Curve> curves;
  int width = 900;  // Pixels.
  int height = 300;
};

// Colours that are told apart also without colour vision; the k-th of them.
Light CurveColor(size_t k);

// Draws the bars, over them the curves.
Image DrawChart(const Chart& chart);

// The colours of a scale with ticks and title, as a strip.
Image DrawScale(const ColorScale& scale, int width, int height);

// Images side by side or one above the other, on a light ground, from the top
// left.
Image Beside(const std::vector<Image>& images);
Image Stacked(const std::vector<Image>& images);

}  // namespace deform
