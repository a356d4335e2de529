// The integrals behind Green coordinates, as they come out of the closed forms:
// before closure and extension, which 2D and 3D share (green.cc).
#pragma once

#include <memory>
#include <vector>

#include "core/mesh/cage.h"
#include "core/mesh/types.h"
#include "core/weights/scheme.h"

namespace deform {

class GreenIntegrals {
 public:
  virtual ~GreenIntegrals() = default;

  // [L08] Eq. 12 for n points: sets phi (n x V) and psi (n x F, model units).
  // touches[i] is set if point i may lie within Tolerance() of a face.
  // Thread-safe. O(n (V + F)).
  virtual void Integrate(const PositionsRef& points, RowMatrix& phi,
                         RowMatrix& psi, std::vector<char>& touches) const = 0;
};

std::unique_ptr<const GreenIntegrals> MakeGreen2d(const Cage& cage);
std::unique_ptr<const GreenIntegrals> MakeGreen3d(const Cage& cage);

// Closer to a face than this, a point lies on it: what rounding its coordinates
// can move it, and what computing the distance can lose.
inline double BoundaryTolerance(const Cage& cage) {
  return 1e-15 * cage.vertices().cwiseAbs().maxCoeff();
}

}  // namespace deform
