// How much a pose distorts a model.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/deform/pose.h"
#include "core/quality/volume.h"
#include "core/weights/binding.h"

namespace deform {

// Values from edges[i] up to edges[i + 1], without that, fall into bin i; the
// last bin has no upper end.
struct Histogram {
  std::vector<double> edges;
  std::vector<int64_t> counts;
};

// At one point of the model.
struct PointQuality {
  int64_t point = 0;
  double distortion = 1;     // Of the Jacobian, sigma_max / sigma_min >= 1.
  double volume_change = 1;  // Its determinant; in 2D of areas.
};

struct PoseQuality {
  // Where the map was measured, by point.
  std::vector<PointQuality> points;
  // Whether these were taken from all points, or from a sample.
  bool sampled = false;
  // Points passed over: too close to the rig (kNearRig) or without weights.
  int64_t near_rig = 0;
  int64_t fixed = 0;

  // Of sigma_max / sigma_min; 1 if no point was measured. A map that flattens
  // space counts as kMostDistorted.
  double distortion_max = 1;
  double distortion_p99 = 1;
  double distortion_median = 1;
  int64_t most_distorted = -1;  // The point; -1 if none was measured.
  // Bins of equal width in the logarithm, ten to a decade, from 1.
  Histogram distortion;

  int64_t fold_overs = 0;  // Points where the determinant is below 0.
  double volume_change_min = 1;
  double volume_change_median = 1;
  double volume_change_max = 1;

  // Of the whole model, deformed as in a frame.
  VolumeKind volume_kind = VolumeKind::kNone;
  double volume_rest = 0;
  double volume_posed = 0;
};

inline constexpr double kMostDistorted = 1e12;

struct PoseQualityRequest {
  Pose pose;  // Right (CheckPoseUpdate).
  // A model with more points is judged by a sample of so many: always the same.
  int64_t max_points = 20000;
};

// Points that MeasurePose() will look at.
int64_t PointsToMeasure(const BindingFacts& binding,
                        const PoseQualityRequest& request);

// Cancelled.
absl::StatusOr<PoseQuality> MeasurePose(
    const std::shared_ptr<const Binding>& binding,
    const PoseQualityRequest& request, const BindControl& control);

}  // namespace deform
