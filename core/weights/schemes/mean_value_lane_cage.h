// A cage as the lane kernels of mean value coordinates read it.
#pragma once

#include <vector>

#include "core/mesh/cage.h"
#include "core/mesh/types.h"
#include "core/weights/schemes/mean_value_lanes.h"

namespace deform {

class MeanValueLaneCage {
 public:
  // Coordinates are uncertain by `rounding`.
  MeanValueLaneCage(const Cage& cage, double rounding);
  MeanValueLaneCage(const MeanValueLaneCage&) = delete;
  MeanValueLaneCage& operator=(const MeanValueLaneCage&) = delete;

  const MeanValueCage& cage() const { return cage_; }

 private:
  void AddEdge(int32_t from, int32_t to);

  const Positions vertices_;
  std::vector<MeanValueEdge> edges_;
  std::vector<MeanValueFace> faces_;
  MeanValueCage cage_;
};

}  // namespace deform
