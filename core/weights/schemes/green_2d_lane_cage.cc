#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/mesh/rig.h"
#include "core/mesh/types.h"
#include "core/weights/schemes/green.h"
#include "core/weights/schemes/green_2d_lanes.h"
#include "core/weights/schemes/green_lanes.h"

namespace deform {
namespace {

// Nearer to an edge than this part of D, the plain way knows better.
constexpr double kTouch = 1e-10;

class Green2dLanes : public GreenLanes {
 public:
  explicit Green2dLanes(const Cage& cage);

  void Integrate(LanePoints& points, void* scratch,
                 double* weights) const override {
    IntegrateGreen2d(loops_, points, scratch, weights);
  }
  void Integrate(LanePoints& points, void* scratch,
                 float* weights) const override {
    IntegrateGreen2d(loops_, points, scratch, weights);
  }
  int64_t ScratchBytes() const override { return Green2dLaneScratch(loops_); }

 private:
  const double scale_;
  const Positions vertices_;
  std::vector<GreenLaneSegment> edges_;
  GreenLaneLoops loops_;
};

Green2dLanes::Green2dLanes(const Cage& cage)
    : scale_(LaneScale(DiagonalOf(cage))), vertices_(cage.vertices() * scale_) {
  for (int64_t e = 0; e < cage.face_count(); ++e) {
    const int32_t from = cage.faces()(e, 0), to = cage.faces()(e, 1);
    const Vec3 a = vertices_.row(to) - vertices_.row(from);
    edges_.push_back({from, to, {a.x(), a.y()}, a.norm()});
  }
  loops_ = {.vertices = vertices_.rows(),
            .edges = static_cast<int64_t>(edges_.size()),
            .vertex = vertices_.data(),
            .edge = edges_.data(),
            .psi = 1 / (2 * std::numbers::pi * scale_),
            .log_unit = -2 * std::log(scale_),
            .touch = std::max(kTouch, 8 * BoundaryTolerance(cage) * scale_)};
}

}  // namespace

std::unique_ptr<const GreenLanes> MakeGreen2dLanes(const Cage& cage) {
  return std::make_unique<Green2dLanes>(cage);
}

}  // namespace deform
