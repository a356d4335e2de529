#include "client/cli/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "client/cli/exit_code.h"
#include "core/mesh/mesh.h"

namespace deform::cli {
namespace {

constexpr double kPi = std::numbers::pi;

// A rig vertex along the rig: `along` from 0 to length on the longest axis,
// `across` and `aside` from the middle of the box.
struct Place {
  double along, across, aside;
};

Place Twist(Place p, double swing, double length) {
  const double angle = 0.5 * kPi * swing * (2 * p.along / length - 1);
  return {p.along, p.across * std::cos(angle) - p.aside * std::sin(angle),
          p.across * std::sin(angle) + p.aside * std::cos(angle)};
}

// Onto an arc with the same length.
Place Bend(Place p, double swing, double length) {
  const double angle = 0.4 * kPi * swing;
  if (std::abs(angle) < 1e-9) return p;
  const double radius = length / angle;
  const double turn = angle * (p.along / length - 0.5);
  return {0.5 * length + (radius - p.across) * std::sin(turn),
          radius - (radius - p.across) * std::cos(turn), p.aside};
}

// Keeps the volume.
Place Stretch(Place p, double swing, double length) {
  const double factor = 1 + 0.4 * swing;
  const double thin = 1 / std::sqrt(factor);
  return {0.5 * length + factor * (p.along - 0.5 * length), thin * p.across,
          thin * p.aside};
}

// A bulge that travels along.
Place Pulse(Place p, double time, double length) {
  const double wave = std::sin(2 * kPi * (time - p.along / length)) +
                      std::sin(2 * kPi * p.along / length);
  const double factor = 1 + 0.12 * wave;
  return {p.along, factor * p.across, factor * p.aside};
}

}  // namespace

std::span<const char* const> MotionNames() {
  static constexpr const char* kNames[] = {"twist", "bend", "stretch", "pulse"};
  return kNames;
}

absl::StatusOr<Positions> PoseOfMotion(const std::string& name,
                                       const Positions& rest, int dimension,
                                       double time) {
  const double swing = std::sin(2 * kPi * time);
  const auto move = [&](Place p, double length) {
    if (name == "twist") return Twist(p, swing, length);
    if (name == "bend") return Bend(p, swing, length);
    if (name == "stretch") return Stretch(p, swing, length);
    return Pulse(p, time, length);
  };
  const auto names = MotionNames();
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return UsageError(absl::StrCat("there is no motion '", name,
                                   "': twist, bend, stretch or pulse"));
  }
  if (name == "twist" && dimension == 2) {
    return UsageError("a flat rig cannot be twisted; bend it");
  }
  const Box box = BoxOf(rest);
  int axis = 0;
  const Vec3 size = box.max - box.min;
  size.maxCoeff(&axis);
  // In 2D the second axis is the other one of the plane.
  const int second = dimension == 2 ? 1 - axis : (axis + 1) % 3;
  const int third = 3 - axis - second;
  const double length = std::max(size[axis], 1e-300);
  Positions posed = rest;
  for (int64_t i = 0; i < rest.rows(); ++i) {
    const Place place = move(
        {rest(i, axis) - box.min[axis], rest(i, second) - box.center()[second],
         rest(i, third) - box.center()[third]},
        length);
    posed(i, axis) = box.min[axis] + place.along;
    posed(i, second) = box.center()[second] + place.across;
    posed(i, third) = box.center()[third] + place.aside;
  }
  return posed;
}

}  // namespace deform::cli
