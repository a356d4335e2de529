// The two potentials of celestial coordinates: both schemes are the minimum of
//
//   Phi(y) = sum over handles i of phi_i(y . q_i),  phi_i strictly convex,
//
// with q_i the unit direction from the point to handle i. Its gradient is
// sum beta_i q_i with beta_i = phi_i'(y . q_i) >= 0, so that at the minimum the
// betas express the point by its handles.
//
// Source: [C16] Cervero, Vinacua, Brunet, "3D Model Deformations with Arbitrary
//   Control Points", Eq. 8 (T-CC) and Eq. 15 (S-CC).
// Departs: Eq. 8 is meant per component. In Eq. 15 the unknown c is replaced by
//   c = kappa y, kappa^2 = lambda^2 + 2 lambda |c|; then mu_i = kappa E(u_i)
//   with E(u) = exp(asinh u), the factor kappa and with it lambda cancel, and
//   what remains is a gradient. So the solution exists and is unique exactly
//   for points strictly inside the convex hull.
#pragma once

#include <cmath>
#include <cstdint>

namespace deform {

// phi, phi' and phi'' at one exponent.
struct PotentialTerms {
  double value;
  double beta;
  double curvature;
};

// T-CC: phi_i(u) = exp(u) + s_i u.
struct ExponentialPotential {
  const double* s;  // One per handle, >= 0.

  PotentialTerms At(int64_t i, double u) const {
    const double e = std::exp(u);
    return {e + s[i] * u, e + s[i], e};
  }
};

// S-CC: phi'(u) = E(u)^2, the same for all handles.
struct AsinhPotential {
  PotentialTerms At(int64_t /*i*/, double u) const {
    const double root = std::sqrt(1 + u * u);
    // For u < 0 the sum u + root would cancel.
    const double e = u < 0 ? 1 / (root - u) : u + root;
    const double beta = e * e;
    return {e * (beta / 6 + 0.5), beta, 2 * beta / root};
  }
};

}  // namespace deform
