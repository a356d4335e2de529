#include "client/cli/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
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

// A heart's: it contracts within the first third, turns and shortens, and takes
// its time to fill again. The volume inside goes down to about a half.
Place Beat(Place p, double time, double length, bool flat) {
  const double squeeze = std::pow(std::sin(kPi * std::pow(time, 0.6)), 2);
  const double thin = 1 - 0.24 * squeeze;
  const double angle = flat ? 0 : 0.35 * squeeze * (2 * p.along / length - 1);
  const double c = thin * std::cos(angle), s = thin * std::sin(angle);
  return {0.5 * length + (1 - 0.14 * squeeze) * (p.along - 0.5 * length),
          c * p.across - s * p.aside, s * p.across + c * p.aside};
}

// A ring of contraction that comes in at one end and leaves at the other.
Place Wave(Place p, double time, double length) {
  constexpr double kReach = 0.35;  // To either side, in lengths.
  const double middle = time * (1 + 2 * kReach) - kReach;
  const double off = std::abs(p.along / length - middle) / kReach;
  const double thin =
      off < 1 ? 1 - 0.4 * std::pow(std::cos(0.5 * kPi * off), 2) : 1;
  return {p.along, thin * p.across, thin * p.aside};
}

// How far a place takes part in a motion of what lies inside: 1 up to the
// middles of the box's sides, 0 at its corners. `out` are its coordinates from
// the middle of the box, in half sides.
double ShareOf(const Vec3& out, int dimension) {
  const double reach = std::sqrt(dimension);
  const double t =
      std::clamp((reach - out.head(dimension).norm()) / (reach - 1), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Place Between(const Place& a, const Place& b, double t) {
  return {a.along + t * (b.along - a.along),
          a.across + t * (b.across - a.across),
          a.aside + t * (b.aside - a.aside)};
}

}  // namespace

const std::vector<std::string>& MotionNames() {
  static const auto& names = *new std::vector<std::string>{
      "twist", "bend", "stretch", "pulse", "beat", "wave"};
  return names;
}

std::string MotionList() {
  const std::vector<std::string>& names = MotionNames();
  return absl::StrCat(absl::StrJoin(names.begin(), names.end() - 1, ", "),
                      " or ", names.back());
}

absl::StatusOr<Positions> PoseOfMotion(const std::string& name,
                                       const Positions& rest, int dimension,
                                       double time) {
  const double swing = std::sin(2 * kPi * time);
  const auto move = [&](Place p, double length) {
    if (name == "twist") return Twist(p, swing, length);
    if (name == "bend") return Bend(p, swing, length);
    if (name == "stretch") return Stretch(p, swing, length);
    if (name == "beat") return Beat(p, time, length, dimension == 2);
    if (name == "wave") return Wave(p, time, length);
    return Pulse(p, time, length);
  };
  const bool inner = name == "beat" || name == "wave";
  const std::vector<std::string>& names = MotionNames();
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return UsageError(
        absl::StrCat("there is no motion '", name, "': ", MotionList()));
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
    const Place from = {rest(i, axis) - box.min[axis],
                        rest(i, second) - box.center()[second],
                        rest(i, third) - box.center()[third]};
    Place place = move(from, length);
    if (inner) {
      const Vec3 out = (rest.row(i).transpose() - box.center())
                           .cwiseQuotient(0.5 * size.cwiseMax(1e-300));
      place = Between(from, place, ShareOf(out, dimension));
    }
    posed(i, axis) = box.min[axis] + place.along;
    posed(i, second) = box.center()[second] + place.across;
    posed(i, third) = box.center()[third] + place.aside;
  }
  return posed;
}

}  // namespace deform::cli
