#include "core/quality/pose_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <utility>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "core/base/status_macros.h"
#include "core/deform/deformer.h"
#include "core/quality/pose_map.h"

namespace deform {
namespace {

// Some milliseconds of work; neighbours, so that solvers start well.
constexpr int64_t kPointsPerBlock = 64;
constexpr int kBins = 31;
constexpr double kBinsPerDecade = 10;
constexpr double kMostChange = std::numeric_limits<double>::max();

// `count` of [0, total), ascending; all if there are no more.
std::vector<int64_t> Sample(int64_t total, int64_t count) {
  std::vector<int64_t> sample;
  if (count >= total) {
    sample.resize(total);
    std::iota(sample.begin(), sample.end(), 0);
    return sample;
  }
  // Knuth's selection sampling: each point with the chance that is left.
  std::mt19937_64 random(20080811);
  sample.reserve(count);
  for (int64_t i = 0; std::ssize(sample) < count; ++i) {
    const auto left = static_cast<uint64_t>(total - i);
    if (random() % left < static_cast<uint64_t>(count - std::ssize(sample))) {
      sample.push_back(i);
    }
  }
  return sample;
}

template <typename Matrix>
PointQuality QualityOf(int64_t point, const Matrix& jacobian) {
  const auto sigma = Eigen::JacobiSVD<Matrix>(jacobian).singularValues().eval();
  const double largest = sigma[0];
  const double smallest = sigma[sigma.size() - 1];
  const double change = jacobian.determinant();
  // A pose may be as large as doubles are: comparisons refuse NaN too.
  return {
      point,
      largest < kMostDistorted * smallest ? largest / smallest : kMostDistorted,
      std::abs(change) <= kMostChange ? change
                                      : std::copysign(kMostChange, change)};
}

PointQuality QualityOf(int64_t point, const Eigen::Matrix3d& jacobian,
                       int dimension) {
  if (dimension == 3) return QualityOf(point, jacobian);
  return QualityOf(point, Eigen::Matrix2d(jacobian.topLeftCorner<2, 2>()));
}

// At one point that was looked at.
struct Found {
  Measured measured = Measured::kFixed;
  PointQuality quality;
};

// The value below which `part` of all lie; reorders them.
double Quantile(std::vector<double>& values, double part) {
  const auto at = values.begin() +
                  std::llround(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

Histogram EmptyHistogram() {
  Histogram histogram;
  for (int i = 0; i < kBins; ++i) {
    histogram.edges.push_back(std::pow(10, i / kBinsPerDecade));
  }
  histogram.counts.assign(kBins, 0);
  return histogram;
}

void Summarise(PoseQuality& quality) {
  quality.distortion = EmptyHistogram();
  if (quality.points.empty()) return;
  std::vector<double> distortion, volume;
  const std::vector<double>& edges = quality.distortion.edges;
  for (const PointQuality& point : quality.points) {
    distortion.push_back(point.distortion);
    volume.push_back(point.volume_change);
    quality.fold_overs += point.volume_change < 0;
    const auto bin =
        std::upper_bound(edges.begin(), edges.end(), point.distortion);
    // Rounding may leave a ratio of 1 below the first edge.
    ++quality.distortion.counts[std::max<int64_t>(0, bin - edges.begin() - 1)];
    if (quality.most_distorted < 0 ||
        point.distortion > quality.distortion_max) {
      quality.most_distorted = point.point;
      quality.distortion_max = point.distortion;
    }
  }
  quality.distortion_p99 = Quantile(distortion, 0.99);
  quality.distortion_median = Quantile(distortion, 0.5);
  quality.volume_change_min = Quantile(volume, 0);
  quality.volume_change_median = Quantile(volume, 0.5);
  quality.volume_change_max = Quantile(volume, 1);
}

void MeasureVolume(const std::shared_ptr<const Binding>& binding,
                   const Pose& pose, ThreadPool* pool, PoseQuality& quality) {
  const Mesh& model = *binding->model();
  quality.volume_kind = VolumeKindOf(model.faces(), model.dimension());
  if (quality.volume_kind == VolumeKind::kNone) return;
  Deformer deformer(binding, pool);
  deformer.MoveTo(pose);
  const double rest =
      VolumeOf(quality.volume_kind, model.positions(), model.faces());
  const double posed =
      VolumeOf(quality.volume_kind, deformer.positions(), model.faces());
  if (!std::isfinite(posed)) {  // Float cannot hold the pose.
    quality.volume_kind = VolumeKind::kNone;
    return;
  }
  quality.volume_rest = rest;
  quality.volume_posed = posed;
}

}  // namespace

int64_t PointsToMeasure(const BindingFacts& binding,
                        const PoseQualityRequest& request) {
  return std::min(binding.point_count(), request.max_points);
}

absl::StatusOr<PoseQuality> MeasurePose(
    const std::shared_ptr<const Binding>& binding,
    const PoseQualityRequest& request, const BindControl& control) {
  DEFORM_ASSIGN_OR_RETURN(const auto map,
                          PoseMap::Create(*binding, request.pose));
  const std::vector<int64_t> sample =
      Sample(binding->point_count(), PointsToMeasure(*binding, request));
  const int64_t count = std::ssize(sample);
  std::vector<Found> found(count);
  const bool finished =
      ParallelFor(control.pool, (count + kPointsPerBlock - 1) / kPointsPerBlock,
                  control.cancellation, [&](int64_t block) {
                    const int64_t first = block * kPointsPerBlock;
                    const auto points = std::span(sample).subspan(
                        first, std::min(kPointsPerBlock, count - first));
                    const auto derivatives = map->Differentiate(points);
                    for (size_t k = 0; k < points.size(); ++k) {
                      found[first + static_cast<int64_t>(k)] = {
                          derivatives[k].measured,
                          QualityOf(points[k], derivatives[k].jacobian,
                                    binding->dimension())};
                    }
                    if (control.points_done != nullptr) {
                      *control.points_done += std::ssize(points);
                    }
                  });
  if (!finished) {
    return absl::CancelledError("the quality report was cancelled");
  }
  PoseQuality quality;
  quality.sampled = count < binding->point_count();
  for (const Found& point : found) {
    quality.near_rig += point.measured == Measured::kNearRig;
    quality.fixed += point.measured == Measured::kFixed;
    if (point.measured == Measured::kYes) {
      quality.points.push_back(point.quality);
    }
  }
  Summarise(quality);
  MeasureVolume(binding, request.pose, control.pool, quality);
  return quality;
}

}  // namespace deform
