#include "client/pictures/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/error.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

// Half the vertical angle of view: narrow enough not to distort.
constexpr double kHalfAngle = 13 * std::numbers::pi / 180;

Box BoxOfAll(const std::vector<PositionsRef>& points) {
  Box box = BoxOf(points.front());
  for (const PositionsRef& rows : points) {
    const Box other = BoxOf(rows);
    box.min = box.min.cwiseMin(other.min);
    box.max = box.max.cwiseMax(other.max);
  }
  return box;
}

// Columns: to the right of the front view, up, and towards its eye.
Eigen::Matrix3d FrontFrame(View::Up up) {
  Eigen::Matrix3d frame;
  switch (up) {
    case View::Up::kX:
      frame << 0, 1, 0, 1, 0, 0, 0, 0, -1;
      break;
    case View::Up::kY:
      frame << 1, 0, 0, 0, 1, 0, 0, 0, 1;
      break;
    case View::Up::kZ:
      frame << 1, 0, 0, 0, 0, -1, 0, 1, 0;
      break;
  }
  return frame;
}

}  // namespace

absl::StatusOr<View> ParseView(absl::string_view text, View::Up up) {
  struct Named {
    const char* name;
    double azimuth;
    double elevation;
  };
  constexpr Named kNamed[] = {{"front", 0, 0},  {"right", 90, 0},
                              {"back", 180, 0}, {"left", 270, 0},
                              {"top", 0, 90},   {"bottom", 0, -90}};
  if (text == "auto") return View{.up = up};
  for (const Named& named : kNamed) {
    if (text == named.name) {
      return View{up, false, named.azimuth, named.elevation};
    }
  }
  const std::vector<absl::string_view> parts = absl::StrSplit(text, ',');
  View view{.up = up, .automatic = false};
  if (parts.size() != 2 || !absl::SimpleAtod(parts[0], &view.azimuth) ||
      !absl::SimpleAtod(parts[1], &view.elevation) ||
      !(std::abs(view.azimuth) <= 360) || !(std::abs(view.elevation) <= 90)) {
    return InvalidInput("BAD_VIEW", "--view",
                        absl::StrCat("'", text,
                                     "' is no view: auto, front, back, left, "
                                     "right, top, bottom or AZIMUTH,ELEVATION "
                                     "(degrees, within 360 and 90)"));
  }
  return view;
}

Camera Camera::Fit(const std::vector<PositionsRef>& points, const View& view,
                   int width, int height, double margin, double header) {
  Camera camera;
  const double top = std::min(header, 0.5 * height);
  const Eigen::Matrix3d front = FrontFrame(view.up);
  const Box box = BoxOfAll(points);
  double azimuth = view.azimuth;
  double elevation = view.elevation;
  if (view.automatic) {
    const Vec3 size = (front.transpose() * (box.max - box.min)).cwiseAbs();
    azimuth = size.x() >= 0.8 * size.z() ? 28 : 62;
    elevation = 18;
  }
  const double a = azimuth * std::numbers::pi / 180;
  const double e = elevation * std::numbers::pi / 180;
  Eigen::Matrix3d axes;
  axes << std::cos(a), 0, -std::sin(a), -std::sin(e) * std::sin(a), std::cos(e),
      -std::sin(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e),
      std::cos(e) * std::cos(a);
  camera.axes_ = axes * front.transpose();
  camera.target_ = box.center();
  camera.center_x_ = 0.5 * width;
  camera.center_y_ = 0.5 * (height + top);
  camera.scale_ = 0.5 * height / std::tan(kHalfAngle);
  camera.Frame(points, (0.5 - margin) * width, (0.5 - margin) * (height - top));
  return camera;
}

void Camera::Frame(const std::vector<PositionsRef>& points, double half_width,
                   double half_height) {
  // What must not leave the frame is the slope of the ray to every point. The
  // middle of the slopes moves with the distance, so settle in a few rounds.
  const double diagonal = std::max(BoxOfAll(points).diagonal(), 1e-300);
  const double slope_x = half_width / scale_;
  const double slope_y = half_height / scale_;
  for (int round = 0; round < 8; ++round) {
    double needed = 0;
    double nearest = -diagonal;
    for (const PositionsRef& rows : points) {
      for (int64_t i = 0; i < rows.rows(); ++i) {
        const Vec3 p = axes_ * (rows.row(i).transpose() - target_);
        needed = std::max({needed, std::abs(p.x()) / slope_x + p.z(),
                           std::abs(p.y()) / slope_y + p.z()});
        nearest = std::max(nearest, p.z());
      }
    }
    distance_ = std::max(needed, nearest + 0.25 * diagonal);
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
    Vec3 high = -low;
    for (const PositionsRef& rows : points) {
      for (int64_t i = 0; i < rows.rows(); ++i) {
        const Vec3 p = axes_ * (rows.row(i).transpose() - target_);
        const Vec3 slope = p / (distance_ - p.z());
        low = low.cwiseMin(slope);
        high = high.cwiseMax(slope);
      }
    }
    target_ +=
        axes_.row(0).transpose() * (0.5 * (low.x() + high.x()) * distance_);
    target_ +=
        axes_.row(1).transpose() * (0.5 * (low.y() + high.y()) * distance_);
  }
}

Camera Camera::Flat(const std::vector<PositionsRef>& points, int width,
                    int height, double margin, double header) {
  Camera camera;
  const double top = std::min(header, 0.5 * height);
  const Box box = BoxOfAll(points);
  const Vec3 size = box.max - box.min;
  const double tiny = std::max(1e-9 * size.norm(), 1e-300);
  camera.flat_ = true;
  camera.target_ = box.center();
  camera.center_x_ = 0.5 * width;
  camera.center_y_ = 0.5 * (height + top);
  camera.scale_ =
      (1 - 2 * margin) * std::min(width / std::max(size.x(), tiny),
                                  (height - top) / std::max(size.y(), tiny));
  return camera;
}

Projected Camera::Project(const Vec3& point) const {
  const Vec3 p = axes_ * (point - target_);
  const double away = flat_ ? 1 : distance_ - p.z();
  const double scale = scale_ / away;
  return {center_x_ + scale * p.x(), center_y_ - scale * p.y(),
          flat_ ? 1 : away / distance_};
}

Vec3 Camera::ToEye(const Vec3& point) const {
  const Vec3 towards = axes_.row(2).transpose();
  if (flat_) return towards;
  return (target_ + distance_ * towards - point).normalized();
}

}  // namespace deform
