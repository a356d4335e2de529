#include "client/load/pose_pattern.h"

#include <cassert>
#include <cmath>
#include <numbers>

namespace deform {
namespace {

constexpr double kPathSeconds = 2;
constexpr double kPathRadius = 0.05;    // In units of D.
constexpr double kJitterRadius = 0.01;  // Likewise.

// Steele, Lea, Flood, "Fast Splittable Pseudorandom Number Generators", 2014:
// the finalizer of SplitMix64.
uint64_t Mix(uint64_t x) {
  x += 0x9e3779b97f4a7c15;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
  return x ^ (x >> 31);
}

// From -1 to 1.
double Random(uint64_t seed) {
  return static_cast<double>(Mix(seed) >> 11) * 0x1p-52 - 1;
}

}  // namespace

PosePattern::PosePattern(Kind kind, const Rig& rig, int editors, double rate,
                         std::vector<Positions> sequence)
    : kind_(kind),
      dimension_(DimensionOf(rig)),
      diagonal_(DiagonalOf(rig)),
      rate_(rate),
      rest_(RestPose(rig)),
      pose_rows_(PoseRows(rig)),
      sequence_(std::move(sequence)),
      owned_(editors) {
  assert(editors >= 1 && editors <= pose_rows_);
  assert(kind != Kind::kSequence || !sequence_.empty());
  for (int64_t v = 0; v < pose_rows_; ++v) {
    owned_[v % editors].push_back(static_cast<int32_t>(v));
  }
}

Positions PosePattern::Places(int64_t session,
                              std::span<const int32_t> vertices,
                              uint64_t number) const {
  Positions places(vertices.size(), 3);
  const uint64_t seed = Mix(Mix(session) ^ number);
  const double turn = 2 * std::numbers::pi *
                      (static_cast<double>(number) / (rate_ * kPathSeconds) +
                       0.5 * Random(session));
  const Vec3 path(std::cos(turn), std::sin(turn), 0.5 * std::sin(2 * turn));
  for (size_t i = 0; i < vertices.size(); ++i) {
    const int32_t v = vertices[i];
    Vec3 place = rest_.vertices.row(v);
    for (int k = 0; k < dimension_; ++k) {
      if (kind_ == Kind::kDrag) {
        place[k] += kPathRadius * diagonal_ * path[k];
      } else if (kind_ == Kind::kJitter) {
        place[k] += kJitterRadius * diagonal_ * Random(seed + 3 * v + k);
      } else {
        place[k] = sequence_[(number + session) % sequence_.size()](v, k);
      }
    }
    places.row(i) = place;
  }
  return places;
}

PoseUpdate PosePattern::At(int64_t session, int editor, uint64_t number) const {
  const std::vector<int32_t>& owned = owned_[editor];
  PoseUpdate update;
  if (kind_ == Kind::kDrag) {
    update.vertices = {owned[session % owned.size()]};
  } else {
    update.vertices = owned;
  }
  update.positions = Places(session, update.vertices, number);
  // All in order need not be named.
  if (static_cast<int64_t>(update.vertices.size()) == pose_rows_) {
    update.vertices.clear();
  }
  return update;
}

Pose PosePattern::Merged(int64_t session,
                         std::span<const uint64_t> numbers) const {
  Pose pose = rest_;
  for (size_t e = 0; e < numbers.size(); ++e) {
    if (numbers[e] == 0) continue;
    ApplyPoseUpdate(At(session, static_cast<int>(e), numbers[e]), pose);
  }
  return pose;
}

}  // namespace deform
