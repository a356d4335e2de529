// Mean value coordinates of a closed cage, 2D and 3D: the scheme that others
// are compared with.
//
// Source: [J05] Ju, Schaefer, Warren, "Mean Value Coordinates for Closed
//   Triangular Meshes", ACM TOG 24(3), 2005; 2D: Floater, "Mean value
//   coordinates", 2003. eta is the point.
// Departs: 3D in the edge and plane distances of a face, equal to [J05], whose
//   pseudocode divides by zero on the line of an edge and loses half the digits
//   next to one. On the cage the barycentrics are set, which are the limit.
// Precision: 1e-15 inside and next to the cage, 1e-12 outside, times the aspect
//   of sliver faces.
// Cost: three to nine atan2 per face and point.
#include "core/weights/schemes/mean_value.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <variant>

#include "absl/strings/str_cat.h"
#include "core/base/aligned_array.h"
#include "core/base/error.h"
#include "core/weights/cage_faces.h"
#include "core/weights/schemes/mean_value_face.h"
#include "core/weights/schemes/mean_value_lane_cage.h"

namespace deform {
namespace {

using Weights = std::span<double>;
using Face = CageFaces::Face;

// So far, in units of the largest coordinate, a point on a face may be off it
// by rounding.
constexpr double kOnCage = 1e-15;

// In double, and within the precision of float: how flat faces may be seen for
// their terms to keep their digits, and what their sum must reproduce.
struct Precision {
  double edge_on;
  double tolerance;
};
constexpr Precision kInDouble = {1e-2, 1e-12};
constexpr Precision kInFloat = {1e-4, 1e-9};

class MeanValueEvaluator final : public LaneEvaluator {
 public:
  MeanValueEvaluator(const Cage& cage, Way way)
      : LaneEvaluator(way, cage.vertex_count(), 0, /*lane_scale=*/1,
                      PointState::kBoundOutside),
        faces_(cage),
        vertices_(cage.vertex_count()),
        largest_coordinate_(cage.vertices().cwiseAbs().maxCoeff()),
        lanes_(cage, kOnCage * largest_coordinate_) {}

  void EvaluateLanes(LanePoints& points, void* scratch,
                     double* weights) const override {
    Sum(points, kInDouble, scratch, weights);
    NormaliseMeanValues(lanes_.cage(), points, kInDouble.tolerance, weights);
  }
  void EvaluateLanes(LanePoints& points, void* scratch,
                     float* weights) const override {
    auto* exact = static_cast<double*>(scratch);
    Sum(points, kInFloat, exact + vertices_ * kTilePoints, exact);
    NormaliseMeanValues(lanes_.cage(), points, kInFloat.tolerance, exact,
                        weights);
  }
  int64_t ScratchBytes() const override {
    return vertices_ * kTilePoints * int64_t{sizeof(double)} +
           MeanValueScratch(lanes_.cage()) +
           lanes_.cage().faces * int64_t{sizeof(uint32_t)};
  }

 private:
  PointState EvaluatePoint(const Vec3& eta, Weights weights,
                           Weights normals) const override;
  std::array<double, 3> SharesOf(int64_t f, const Vec3& eta) const {
    return faces_.corners() == 2 ? MeanValueOfEdge(faces_[f], eta)
                                 : MeanValueOfTriangle(faces_[f], eta);
  }
  void Sum(LanePoints& points, const Precision& precision, void* scratch,
           double* weights) const;
  std::optional<CageFaces::Nearest> Touched(const Vec3& eta) const;

  const CageFaces faces_;
  const int64_t vertices_;
  const double largest_coordinate_;
  const MeanValueLaneCage lanes_;
};

PointState MeanValueEvaluator::EvaluatePoint(const Vec3& eta, Weights weights,
                                             Weights /*normals*/) const {
  std::fill(weights.begin(), weights.end(), 0);
  if (const auto touched = Touched(eta)) {
    const Face& face = faces_[touched->face];
    for (int k = 0; k < faces_.corners(); ++k) {
      weights[face.corner[k]] = touched->barycentric[k];
    }
    return PointState::kBoundary;
  }
  double sum = 0;
  for (int64_t f = 0; f < faces_.size(); ++f) {
    const std::array<double, 3> shares = SharesOf(f, eta);
    for (int k = 0; k < faces_.corners(); ++k) {
      weights[faces_[f].corner[k]] += shares[k];
    }
  }
  for (const double weight : weights) sum += weight;
  // Of an embedded cage the sum is above 0 inside and below 0 outside.
  if (sum == 0 || !std::isfinite(sum)) {
    std::fill(weights.begin(), weights.end(), 0);
    return PointState::kOverlap;
  }
  for (double& weight : weights) weight /= sum;
  return sum > 0 ? PointState::kInside : PointState::kBoundOutside;
}

// What the lanes left out is added face by face.
void MeanValueEvaluator::Sum(LanePoints& points, const Precision& precision,
                             void* scratch, double* weights) const {
  auto* skew = reinterpret_cast<uint32_t*>(static_cast<char*>(scratch) +
                                           MeanValueScratch(lanes_.cage()));
  SumMeanValues(lanes_.cage(), points, precision.edge_on, scratch, weights,
                skew);
  for (int64_t f = 0; f < lanes_.cage().faces; ++f) {
    for (int64_t lane = 0; skew[f] >> lane != 0; ++lane) {
      if (!((skew[f] & points.solved) >> lane & 1)) continue;
      const Vec3 eta(points.at[0][lane], points.at[1][lane],
                     points.at[2][lane]);
      const std::array<double, 3> shares = SharesOf(f, eta);
      for (int k = 0; k < 3; ++k) {
        weights[faces_[f].corner[k] * kTilePoints + lane] += shares[k];
      }
    }
  }
}

// The face that eta lies on, if any.
std::optional<CageFaces::Nearest> MeanValueEvaluator::Touched(
    const Vec3& eta) const {
  const double tolerance =
      kOnCage * std::max(largest_coordinate_, eta.cwiseAbs().maxCoeff());
  for (int64_t f = 0; f < faces_.size(); ++f) {
    if (!(std::abs(faces_.Height(f, eta)) <= tolerance)) continue;
    const CageFaces::Nearest nearest = faces_.NearestOn(f, eta);
    if (nearest.distance <= tolerance) return nearest;
  }
  return std::nullopt;
}

class MeanValue final : public CoordinateScheme {
 public:
  absl::string_view id() const override { return "mean_value"; }
  absl::string_view description() const override {
    return "Mean value coordinates of a cage, for comparison: no normals, "
           "shears where Green coordinates rotate";
  }
  RigKind rig_kind() const override { return RigKind::kCage; }
  bool uses_normals() const override { return false; }

  absl::StatusOr<std::unique_ptr<const WeightEvaluator>> Prepare(
      const Rig& rig, const SchemeOptions& options) const override;
};

absl::StatusOr<std::unique_ptr<const WeightEvaluator>> MeanValue::Prepare(
    const Rig& rig, const SchemeOptions& options) const {
  const auto* cage = std::get_if<Cage>(&rig);
  if (cage == nullptr) {
    return InvalidInput(
        "WRONG_RIG", "rig",
        absl::StrCat("scheme ", id(), " needs a cage, but the rig is handles"));
  }
  if (!options.handle_weights.empty() || options.lambda != 0) {
    return InvalidInput("INVALID_OPTION", "options",
                        absl::StrCat("scheme ", id(), " has no options"));
  }
  return MakeMeanValueEvaluator(*cage, Way::kLanes);
}

}  // namespace

std::unique_ptr<const LaneEvaluator> MakeMeanValueEvaluator(const Cage& cage,
                                                            Way way) {
  return std::make_unique<MeanValueEvaluator>(cage, way);
}

const CoordinateScheme& MeanValueScheme() {
  static const MeanValue scheme;
  return scheme;
}

}  // namespace deform
