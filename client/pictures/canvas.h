// A surface to draw on, several samples to a pixel, with depth.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/functional/function_ref.h"
#include "client/pictures/camera.h"
#include "client/pictures/image.h"

namespace deform {

// Colour while it is being computed, 0 to 1, not clamped.
using Light = Eigen::Vector3f;

inline Light ToLight(Color color) {
  return Light(color.r, color.g, color.b) / 255.f;
}

// Coordinates are pixels of the finished picture, y downwards. Nothing drawn
// outside of it is an error.
class Canvas {
 public:
  // Samples per pixel along each axis: 9 to a pixel.
  static constexpr int kSamples = 3;

  Canvas(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }

  // From `top` to `bottom`, behind everything.
  void FillBackground(const Light& top, const Light& bottom);

  // Draws a triangle where it is nearest. `shade` gets the barycentric
  // coordinates of each sample.
  void Triangle(const Projected corners[3],
                absl::FunctionRef<Light(const Eigen::Vector3f&)> shade);

  // Darkens the grooves: samples that lie deeper than the surface around them
  // within `radius` pixels, by up to `strength`. Call after the triangles.
  void ShadeGrooves(double radius, float strength);

  // A line with round ends. Where the surface is nearer than the line by more
  // than `slack` (of depth) it is drawn with `hidden_alpha` instead of
  // `alpha`. Lines of one layer do not add up where they cross: FlushLines()
  // lays the layer over the picture.
  void Line(const Projected& from, const Projected& to, double width,
            float alpha, float hidden_alpha, double slack);
  void FlushLines(const Light& color);

  // The finished picture.
  Image Resolve() const;

 private:
  int64_t At(int x, int y) const {
    return static_cast<int64_t>(y) * columns_ + x;
  }

  int width_, height_;
  int columns_, rows_;  // In samples.
  std::vector<Color> colors_;
  std::vector<float> depth_;    // Infinite where nothing is.
  std::vector<uint8_t> lines_;  // Opacity of the line layer.
};

}  // namespace deform
