// A cage as the lane kernels of Green coordinates read it.
#pragma once

#include <cstdint>
#include <memory>

#include "core/mesh/cage.h"
#include "core/weights/schemes/lane_points.h"

namespace deform {

class GreenLanes {
 public:
  virtual ~GreenLanes() = default;

  // Phi and psi of up to 16 points, (V + F) x 16, closed; in double, or within
  // the precision of float. Points come in units of 1 / LaneScale(D). Weights
  // and `scratch`, of ScratchBytes(), are aligned to 64 bytes. Thread-safe.
  virtual void Integrate(LanePoints& points, void* scratch,
                         double* weights) const = 0;
  virtual void Integrate(LanePoints& points, void* scratch,
                         float* weights) const = 0;
  virtual int64_t ScratchBytes() const = 0;
};

std::unique_ptr<const GreenLanes> MakeGreen2dLanes(const Cage& cage);
std::unique_ptr<const GreenLanes> MakeGreen3dLanes(const Cage& cage);

}  // namespace deform
