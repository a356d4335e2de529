#include "client/pictures/chart.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/pictures/text.h"

namespace deform {
namespace {

const Light kGround(0.985f, 0.985f, 0.98f);
const Light kInk(0.22f, 0.25f, 0.29f);
const Light kGrid(0.82f, 0.83f, 0.85f);
constexpr Color kGroundColor = {251, 251, 250};

constexpr double kTextSize = 0.85;
constexpr double kTitleSize = 1.0;

// The place of a value on an axis, from 0 to 1 between its ends.
double PlaceOn(const Axis& axis, double value) {
  if (!axis.logarithmic) return (value - axis.low) / (axis.high - axis.low);
  return std::log(std::max(value, 1e-300) / axis.low) /
         std::log(axis.high / axis.low);
}

// What is nearer hides what is not.
constexpr double kFar = 1, kNear = 0.5;

void FillRectangle(double left, double top, double right, double bottom,
                   double depth, const Light& color, Canvas& canvas) {
  const Projected a{left, top, depth}, b{right, top, depth},
      c{right, bottom, depth}, d{left, bottom, depth};
  const auto fill = [&](const Eigen::Vector3f&) { return color; };
  const Projected upper[3] = {a, b, c}, lower[3] = {a, c, d};
  canvas.Triangle(upper, fill);
  canvas.Triangle(lower, fill);
}

class ChartPainter {
 public:
  explicit ChartPainter(const Chart& chart)
      : chart_(chart),
        canvas_(chart.width, chart.height),
        left_(78),
        right_(chart.width - 24),
        top_(chart.title.empty() && chart.y.title.empty() ? 18 : 46),
        bottom_(chart.height - (chart.x.title.empty() ? 34 : 58)) {
    canvas_.FillBackground(kGround, kGround);
  }

  Image Draw() {
    DrawGrid();
    for (const Bar& bar : chart_.bars) DrawBar(bar);
    for (const Curve& curve : chart_.curves) DrawCurve(curve);
    DrawFrame();
    DrawLegend();
    return canvas_.Resolve();
  }

 private:
  double X(double value) const {
    return left_ + PlaceOn(chart_.x, value) * (right_ - left_);
  }
  double Y(double value) const {
    return bottom_ - PlaceOn(chart_.y, value) * (bottom_ - top_);
  }
  void Line(double x0, double y0, double x1, double y1, double width) {
    canvas_.Line({x0, y0, 1}, {x1, y1, 1}, width, 1, 1, 0);
  }
  std::vector<double> XTicks() const {
    if (!chart_.x.labels.empty()) return {};
    return RoundTicks(chart_.x.low, chart_.x.high, chart_.x.logarithmic,
                      std::max(3, static_cast<int>((right_ - left_) / 75)));
  }
  std::vector<double> YTicks() const {
    return RoundTicks(chart_.y.low, chart_.y.high, chart_.y.logarithmic,
                      std::max(3, static_cast<int>((bottom_ - top_) / 36)));
  }

  void DrawGrid() {
    for (const double tick : XTicks()) Line(X(tick), top_, X(tick), bottom_, 1);
    for (const double tick : YTicks()) Line(left_, Y(tick), right_, Y(tick), 1);
    canvas_.FlushLines(kGrid);
  }

  void DrawBar(const Bar& bar) {
    const double from = std::clamp(X(bar.from), left_, right_);
    const double to = std::clamp(X(bar.to), left_, right_);
    const double top = std::clamp(Y(bar.height), top_, bottom_);
    if (top < bottom_) {
      FillRectangle(from + 0.7, top, to - 0.7, bottom_, kFar, bar.color,
                    canvas_);
    }
  }

  bool Within(double x, double y) const {
    return x >= left_ - 0.5 && x <= right_ + 0.5 && y >= top_ - 0.5 &&
           y <= bottom_ + 0.5;
  }

  void DrawCurve(const Curve& curve) {
    for (size_t i = 0; i < curve.x.size(); ++i) {
      const double x = X(curve.x[i]), y = Y(curve.y[i]);
      if (!Within(x, y)) continue;  // NaN too.
      if (curve.dots) Line(x, y, x, y, 9);
      if (i + 1 == curve.x.size()) continue;
      const double x1 = X(curve.x[i + 1]), y1 = Y(curve.y[i + 1]);
      if (Within(x1, y1)) Line(x, y, x1, y1, 2.6);
    }
    canvas_.FlushLines(curve.color);
  }

  void DrawFrame() {
    Line(left_, top_, left_, bottom_, 1.6);
    Line(left_, bottom_, right_, bottom_, 1.6);
    for (const double tick : XTicks()) {
      DrawText(NumberText(tick), X(tick), bottom_ + 9, kTextSize,
               Align::kCenter, canvas_);
    }
    for (size_t k = 0; k < chart_.x.labels.size(); ++k) {
      DrawText(chart_.x.labels[k], X(static_cast<double>(k) + 0.5), bottom_ + 9,
               kTextSize, Align::kCenter, canvas_);
    }
    for (const double tick : YTicks()) {
      DrawText(NumberText(tick), left_ - 9, Y(tick) - 5, kTextSize,
               Align::kRight, canvas_);
    }
    DrawText(chart_.title, left_, 12, kTitleSize, Align::kLeft, canvas_);
    DrawText(chart_.x.title, 0.5 * (left_ + right_), bottom_ + 34, kTextSize,
             Align::kCenter, canvas_);
    // Upright letters read best: the title of y stands above its axis.
    if (!chart_.y.title.empty()) {
      DrawText(chart_.y.title, right_, 14, kTextSize, Align::kRight, canvas_);
    }
    canvas_.FlushLines(kInk);
  }

  void DrawLegend() {
    double width = 0, lines = 0;
    for (const Curve& curve : chart_.curves) {
      if (curve.name.empty()) continue;
      width = std::max(width, TextWidth(curve.name, kTextSize));
      ++lines;
    }
    if (lines == 0) return;
    const double left = right_ - width - 56, top = top_ + 8;
    FillRectangle(left, top, right_ - 4, top + 22 * lines + 6, kNear, kGround,
                  canvas_);
    double y = top + 8;
    for (const Curve& curve : chart_.curves) {
      if (curve.name.empty()) continue;
      Line(left + 10, y + 5, left + 34, y + 5, 3);
      if (curve.dots) Line(left + 22, y + 5, left + 22, y + 5, 9);
      canvas_.FlushLines(curve.color);
      DrawText(curve.name, left + 44, y, kTextSize, Align::kLeft, canvas_);
      canvas_.FlushLines(kInk);
      y += 22;
    }
  }

  const Chart& chart_;
  Canvas canvas_;
  const double left_, right_, top_, bottom_;
};

Image Ground(int width, int height) {
  Image image{width, height, {}};
  image.pixels.assign(static_cast<size_t>(width) * height, kGroundColor);
  return image;
}

void Paste(const Image& from, int left, int top, Image& onto) {
  for (int y = 0; y < from.height; ++y) {
    std::copy_n(&from.at(0, y), from.width, &onto.at(left, top + y));
  }
}

}  // namespace

Light CurveColor(size_t k) {
  // Okabe and Ito, "Color Universal Design".
  static const std::array<Light, 6> kColors = {
      Light(0.00f, 0.45f, 0.70f), Light(0.84f, 0.37f, 0.00f),
      Light(0.00f, 0.62f, 0.45f), Light(0.80f, 0.47f, 0.65f),
      Light(0.90f, 0.62f, 0.00f), Light(0.34f, 0.71f, 0.91f)};
  return kColors[k % kColors.size()];
}

Image DrawChart(const Chart& chart) { return ChartPainter(chart).Draw(); }

Image DrawScale(const ColorScale& scale, int width, int height) {
  Canvas canvas(width, height);
  canvas.FillBackground(kGround, kGround);
  const double left = 78, right = width - 60, top = 40, bottom = height - 32;
  constexpr int kSteps = 256;
  for (int k = 0; k < kSteps; ++k) {
    const double from = left + (right - left) * k / kSteps;
    const double to = left + (right - left) * (k + 1) / kSteps;
    FillRectangle(from, top, to, bottom, kFar,
                  ColorAt(scale.map, (k + 0.5) / kSteps), canvas);
  }
  for (const double tick : RoundTicks(scale.low, scale.high, scale.logarithmic,
                                      std::max(3, width / 90))) {
    const double x = left + (right - left) * scale.PlaceOf(tick);
    canvas.Line({x, bottom, 1}, {x, bottom + 6, 1}, 1.4, 1, 1, 0);
    DrawText(NumberText(tick), x, bottom + 12, kTextSize, Align::kCenter,
             canvas);
  }
  DrawText(scale.title, left, 14, kTitleSize, Align::kLeft, canvas);
  canvas.FlushLines(kInk);
  return canvas.Resolve();
}

Image Beside(const std::vector<Image>& images) {
  int width = 0, height = 0;
  for (const Image& image : images) {
    width += image.width;
    height = std::max(height, image.height);
  }
  Image all = Ground(width, height);
  int left = 0;
  for (const Image& image : images) {
    Paste(image, left, 0, all);
    left += image.width;
  }
  return all;
}

Image Stacked(const std::vector<Image>& images) {
  int width = 0, height = 0;
  for (const Image& image : images) {
    width = std::max(width, image.width);
    height += image.height;
  }
  Image all = Ground(width, height);
  int top = 0;
  for (const Image& image : images) {
    Paste(image, 0, top, all);
    top += image.height;
  }
  return all;
}

}  // namespace deform
