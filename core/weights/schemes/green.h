// Green coordinates: evaluators, and the integrals behind them as they come out
// of the closed forms, before closure and extension, which 2D and 3D share
// (green.cc).
#pragma once

#include <memory>
#include <span>

#include "core/mesh/cage.h"
#include "core/mesh/types.h"
#include "core/weights/scheme.h"
#include "core/weights/schemes/lane_evaluator.h"

namespace deform {

class GreenIntegrals {
 public:
  virtual ~GreenIntegrals() = default;

  // [L08] Eq. 12: fills phi (V) and psi (F, model units). Returns whether the
  // point may lie within BoundaryTolerance() of a face. Thread-safe. O(V + F).
  virtual bool Integrate(const Vec3& eta, std::span<double> phi,
                         std::span<double> psi) const = 0;
};

std::unique_ptr<const GreenIntegrals> MakeGreen2d(const Cage& cage);
std::unique_ptr<const GreenIntegrals> MakeGreen3d(const Cage& cage);

std::unique_ptr<const LaneEvaluator> MakeGreenEvaluator(const Cage& cage,
                                                        Way way);

// Closer to a face than this, a point lies on it: what rounding its coordinates
// can move it, and what computing the distance can lose.
inline double BoundaryTolerance(const Cage& cage) {
  return 1e-15 * cage.vertices().cwiseAbs().maxCoeff();
}

}  // namespace deform
