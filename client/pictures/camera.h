// From model space to the picture.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/mesh/types.h"

namespace deform {

// Which way a picture looks at a model.
struct View {
  enum class Up { kX, kY, kZ };
  Up up = Up::kY;
  // Degrees around the up axis from the front, and above the horizon. Without
  // them a three-quarter view is chosen that shows the model's longest side.
  bool automatic = true;
  double azimuth = 0;
  double elevation = 0;
};

// "auto", "front", "back", "left", "right", "top", "bottom", or
// "AZIMUTH,ELEVATION" in degrees. InvalidArgument otherwise.
absl::StatusOr<View> ParseView(absl::string_view text, View::Up up);

// A point of the picture: x to the right and y downwards in pixels; `depth`
// grows away from the eye and is 1 at the distance of the model's middle, in a
// flat view everywhere.
struct Projected {
  double x = 0;
  double y = 0;
  double depth = 0;
};

// A pinhole camera that sees all points it was made for. Immutable.
class Camera {
 public:
  // Fits `points` (finite, at least one) into width x height pixels with a
  // margin, in perspective, as `view` says. The uppermost `header` pixels stay
  // free, as far as they leave half of the height.
  static Camera Fit(const std::vector<PositionsRef>& points, const View& view,
                    int width, int height, double margin, double header = 0);
  // Looks down on the plane z = 0, without perspective, x to the right.
  static Camera Flat(const std::vector<PositionsRef>& points, int width,
                     int height, double margin, double header = 0);

  Projected Project(const Vec3& point) const;
  // From a point of the scene to the eye.
  Vec3 ToEye(const Vec3& point) const;
  // Rows: right, up and towards the eye.
  const Eigen::Matrix3d& axes() const { return axes_; }

 private:
  Camera() = default;
  // Moves the target and the distance so that all points fit.
  void Frame(const std::vector<PositionsRef>& points, double half_width,
             double half_height);

  Eigen::Matrix3d axes_ = Eigen::Matrix3d::Identity();
  Vec3 target_ = Vec3::Zero();
  bool flat_ = false;
  double distance_ = 1;  // Of the eye from the target.
  double scale_ = 1;     // Pixels for a slope of 1 (flat: a model unit).
  double center_x_ = 0;
  double center_y_ = 0;
};

}  // namespace deform
