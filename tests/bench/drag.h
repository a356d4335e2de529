// Poses of which few vertices move.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/deform/deformer.h"

namespace deform::bench {

// The rig bent: no similarity, and different for every `step`.
Pose Bent(const Rig& rig, int step);

// A session whose vertices are dragged, as many as touch a share of the
// columns.
class Drag {
 public:
  enum class Kind {
    kNeighbours,  // The same vertices at every step, next to each other.
    kScattered,   // The same vertices at every step, from all over the rig.
    kOthers,      // Neighbours, but others at every step.
  };
  Drag(std::shared_ptr<const Binding> binding, double share, Kind kind);

  void Step();

  // Applied in a step.
  double columns() const { return columns_; }
  // False for kOthers if the rig has not enough of them.
  bool possible() const { return columns_ > 0; }
  // How far the session is from a full pass, in units of D.
  double Error() const;

 private:
  std::shared_ptr<const Binding> binding_;
  Deformer deformer_;
  Pose pose_;
  std::vector<int64_t> order_;  // In which vertices are taken.
  int64_t moved_ = 0;
  int64_t groups_ = 1;  // That take turns.
  int64_t step_ = 0;
  double columns_ = 0;
};

}  // namespace deform::bench
