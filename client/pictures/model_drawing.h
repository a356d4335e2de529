// The model of a picture: shaded, in bands or as points.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "client/pictures/camera.h"
#include "client/pictures/canvas.h"
#include "client/pictures/color_scale.h"
#include "core/mesh/types.h"

namespace deform {

// The colours of a panel's points, from place to place of a face.
class Paint {
 public:
  Paint(const ColorScale& scale, const std::vector<double>& values)
      : map_(scale.map) {
    for (const double value : values) places_.push_back(scale.PlaceOf(value));
  }

  bool empty() const { return places_.empty(); }
  double PlaceOf(int64_t point) const { return places_[point]; }

  // At barycentric coordinates of a face with these corners.
  double PlaceOf(const Faces& faces, int64_t f,
                 const Eigen::Vector3f& at) const {
    double place = 0;
    for (int k = 0; k < 3; ++k) place += at[k] * places_[faces(f, k)];
    return place;
  }
  Light ColorOf(double place) const;

 private:
  ColorMap map_;
  std::vector<double> places_;
};

std::vector<Projected> ProjectAll(const Camera& camera,
                                  const Positions& positions);

// 3D: lit, in the colours of `paint` or, if it is empty, in one of its own.
void DrawShaded(const Positions& positions, const Faces& faces,
                const Paint& paint, const Camera& camera, Canvas& canvas);

// 2D: tiles of the size of a 16th of the rest model, by where a place was at
// rest.
void DrawChequered(const Positions& positions, const Positions& rest,
                   const Faces& faces, const Camera& camera, Canvas& canvas);

// 2D: every other band of colour a little darker.
void DrawBands(const Positions& positions, const Faces& faces,
               const Paint& paint, const Camera& camera, Canvas& canvas);

// 2D: edges of one triangle only.
void DrawOutline(const Positions& positions, const Faces& faces,
                 const Camera& camera, double width, Canvas& canvas);

// Without faces, in the colours of `paint` or, if it is empty, in one.
void DrawPoints(const Positions& positions, const Paint& paint,
                const Camera& camera, double width, Canvas& canvas);

}  // namespace deform
