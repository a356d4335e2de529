// Closed forms evaluated by lanes: tile by tile, hard points the plain way.
#pragma once

#include <cstdint>
#include <span>

#include "core/weights/scheme.h"
#include "core/weights/schemes/lane_points.h"

namespace deform {

// kPlain is the judge of kLanes, and what it is measured against.
enum class Way { kPlain, kLanes };

// What a scheme of a closed form writes besides its formulas.
class LaneEvaluator : public WeightEvaluator {
 public:
  void Evaluate(const PositionsRef& points, WeightBlock& block) const final;
  void EvaluateTiles(const PositionsRef& points, TileBlock& block) const final;

  // The lanes alone, as the above use them: up to 16 points from row `first`
  // on,
  LanePoints PointsAt(const PositionsRef& points, int64_t first) const;
  // their weights, (V + F) x 16, and which of them came out; the latter within
  // the precision of float. `scratch` has ScratchBytes(), and both are aligned
  // to 64 bytes.
  virtual void EvaluateLanes(LanePoints& points, void* scratch,
                             double* weights) const = 0;
  virtual void EvaluateLanes(LanePoints& points, void* scratch,
                             float* weights) const = 0;
  virtual int64_t ScratchBytes() const = 0;

 protected:
  // Lanes work on points times `lane_scale`, a power of two. With Way::kPlain
  // they are not used at all. Lanes that are not `inside` are
  // `outside_state`.
  LaneEvaluator(Way way, int64_t vertices, int64_t normals, double lane_scale,
                PointState outside_state)
      : way_(way),
        vertices_(vertices),
        normals_(normals),
        lane_scale_(lane_scale),
        outside_state_(outside_state) {}

 private:
  // Fills the weights of one point, all of them.
  virtual PointState EvaluatePoint(const Vec3& point, std::span<double> vertex,
                                   std::span<double> normal) const = 0;

  int64_t columns() const { return vertices_ + normals_; }
  void EvaluatePlain(const PositionsRef& points, WeightBlock& block) const;
  PointState StateOf(const LanePoints& points, int64_t lane) const;

  const Way way_;
  const int64_t vertices_;
  const int64_t normals_;
  const double lane_scale_;
  const PointState outside_state_;
};

// A power of two that brings `size` between 1 and 2.
double LaneScale(double size);

}  // namespace deform
