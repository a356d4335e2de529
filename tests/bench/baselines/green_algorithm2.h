// Green coordinates as the paper computes them, to measure against.
//
// Source: [L08] Lipman, Levin, Cohen-Or, "Green Coordinates", ACM TOG 27(3),
//   2008, Algorithm 2 and GCTriInt, in the paper's names.
// Departs: the logarithm has sqrt(lambda^2 + lambda c S^2) where the paper
//   prints sqrt(lambda^2 + c^2), with which psi comes out wrong.
// Precision: half the digits; not a number next to an edge.
#pragma once

#include <span>

#include "core/mesh/cage.h"
#include "core/mesh/types.h"

namespace deform::bench {

// Fills phi (V) and psi (F) of a point within a 3D cage.
void GreenAlgorithm2(const Cage& cage, const Vec3& eta, std::span<double> phi,
                     std::span<double> psi);

}  // namespace deform::bench
