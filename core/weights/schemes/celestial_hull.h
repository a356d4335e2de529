// Points on the hull of their handles, where the potential has no minimum but
// the weights have a limit: those of the same scheme on the supporting face,
// edge or vertex alone.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/weights/schemes/celestial_newton.h"

namespace deform {

// A face (rank 2) or edge (rank 1) of the handles' hull, with the point on it.
struct HullFace {
  std::vector<int64_t> handles;  // Those on it, ascending.
  Directions directions;         // Theirs, in coordinates of the face.
};

// Looks for the hull face that contains the point within `tolerance` (a
// length). `weights` are those of an unfinished search, of which the face keeps
// all but very little, and `outward` is a direction in which the hull ends at
// the point.
//
// They only propose: a face is returned when all other handles lie on one side
// of a plane through it, so that no point inside is taken for one on the hull.
std::optional<HullFace> FindHullFace(const Directions& directions,
                                     std::span<const double> weights,
                                     const Vec3& outward, double tolerance);

}  // namespace deform
