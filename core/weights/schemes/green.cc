// Green coordinates: closure of the integrals and extension through an exit
// face, alike in 2D and 3D.
//
// Source: Lipman, Levin, Cohen-Or, "Green Coordinates", ACM TOG 27(3), 2008
//   [L08], section 4.2 and Eq. 17-19.
// Departs: on the boundary the limit from inside instead of the factor 1/2 of
//   section 4, which holds within a face only; alpha by distances from the
//   edges of the exit face instead of a linear system.

#include "core/weights/schemes/green.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/base/error.h"
#include "core/mesh/rig.h"
#include "core/weights/cage_faces.h"
#include "core/weights/schemes/green_gradient.h"
#include "core/weights/schemes/green_lanes.h"

namespace deform {
namespace {

class GreenEvaluator final : public LaneEvaluator {
 public:
  GreenEvaluator(const Cage& cage, Way way)
      : LaneEvaluator(way, cage.vertex_count(), cage.face_count(),
                      LaneScale(DiagonalOf(cage)), PointState::kOutside),
        faces_(cage),
        vertices_(cage.vertex_count()),
        tolerance_(BoundaryTolerance(cage)),
        integrals_(cage.dimension() == 2 ? MakeGreen2d(cage)
                                         : MakeGreen3d(cage)),
        lanes_(cage.dimension() == 2 ? MakeGreen2dLanes(cage)
                                     : MakeGreen3dLanes(cage)) {}

  std::array<WeightShare, 4> Extend(const Vec3& point,
                                    int64_t exit_face) const override;
  bool Differentiate(const Vec3& point, int64_t exit_face,
                     Eigen::Ref<Positions> vertex,
                     Eigen::Ref<Positions> normal) const override;
  void EvaluateLanes(LanePoints& points, void* scratch,
                     double* weights) const override {
    lanes_->Integrate(points, scratch, weights);
  }
  void EvaluateLanes(LanePoints& points, void* scratch,
                     float* weights) const override {
    lanes_->Integrate(points, scratch, weights);
  }
  int64_t ScratchBytes() const override { return lanes_->ScratchBytes(); }

 private:
  PointState EvaluatePoint(const Vec3& eta, std::span<double> phi,
                           std::span<double> psi) const override;
  PointState Close(const Vec3& eta, bool touches, std::span<double> phi) const;

  const CageFaces faces_;
  const int64_t vertices_;
  const double tolerance_;
  const std::unique_ptr<const GreenIntegrals> integrals_;
  const std::unique_ptr<const GreenLanes> lanes_;
};

// Makes phi of eta sum to 1 inside and on the boundary, to 0 outside, by adding
// what is missing at the closest point of the cage. Off the boundary this
// removes rounding: it comes from the solid angles of the faces close by, which
// multiply the same barycentrics. On the boundary it is the step of the limit
// from inside, at faces, edges and vertices alike.
PointState GreenEvaluator::Close(const Vec3& eta, bool touches,
                                 std::span<double> phi) const {
  const double winding = std::accumulate(phi.begin(), phi.end(), 0.0);
  const bool inside = winding > 0.5;
  const double missing = (inside ? 1 : 0) - winding;
  const PointState state = inside ? PointState::kInside : PointState::kOutside;
  if (!touches && std::abs(missing) < 1e-14) return state;

  const CageFaces::Nearest nearest = faces_.NearestOf(eta);
  const bool boundary = nearest.distance <= tolerance_;
  // Before the closure, which would hide it. Within rounding of an edge, faces
  // may be on the wrong side of the point by a whole turn.
  if (!boundary && !(winding > -0.5 && winding < 1.5)) {
    return PointState::kOverlap;
  }
  for (int k = 0; k < faces_.corners(); ++k) {
    phi[faces_[nearest.face].corner[k]] +=
        (boundary ? 1 - winding : missing) * nearest.barycentric[k];
  }
  return boundary ? PointState::kBoundary : state;
}

PointState GreenEvaluator::EvaluatePoint(const Vec3& eta, std::span<double> phi,
                                         std::span<double> psi) const {
  const bool touches = integrals_->Integrate(eta, phi, psi);
  const PointState state = Close(eta, touches, phi);
  if (state == PointState::kOverlap) {
    std::fill(phi.begin(), phi.end(), 0);
    std::fill(psi.begin(), psi.end(), 0);
  }
  return state;
}

std::array<WeightShare, 4> GreenEvaluator::Extend(const Vec3& point,
                                                  int64_t exit_face) const {
  const CageFaces::Face& face = faces_[exit_face];
  const Vec3 alpha = faces_.Barycentric(exit_face, point);
  const double beta = faces_.Height(exit_face, point);
  std::array<WeightShare, 4> shares;
  for (int k = 0; k < faces_.corners(); ++k) {
    shares[k] = {face.corner[k], alpha[k]};
  }
  shares[3] = {vertices_ + exit_face, beta};
  return shares;
}

// The closure is rounding; what is left of it is constant.
bool GreenEvaluator::Differentiate(const Vec3& point, int64_t exit_face,
                                   Eigen::Ref<Positions> vertex,
                                   Eigen::Ref<Positions> normal) const {
  GreenGradients(faces_, point, vertex, normal);
  if (exit_face < 0) return true;
  const CageFaces::Face& face = faces_[exit_face];
  for (int k = 0; k < faces_.corners(); ++k) {
    vertex.row(face.corner[k]) -= face.m[k].transpose() / face.height[k];
  }
  normal.row(exit_face) += face.normal.transpose();
  return true;
}

class Green : public CoordinateScheme {
 public:
  absl::string_view id() const override { return "green"; }
  absl::string_view description() const override {
    return "Green coordinates: cage, conformal in 2D, quasi-conformal in 3D";
  }
  RigKind rig_kind() const override { return RigKind::kCage; }
  bool uses_normals() const override { return true; }

  absl::StatusOr<std::unique_ptr<const WeightEvaluator>> Prepare(
      const Rig& rig, const SchemeOptions& options) const override {
    const Cage* cage = std::get_if<Cage>(&rig);
    if (cage == nullptr) {
      return InvalidInput("WRONG_RIG", "rig", "Green coordinates need a cage");
    }
    if (!options.handle_weights.empty() || options.lambda != 0) {
      return InvalidInput("INVALID_OPTION", "options",
                          "Green coordinates take no options");
    }
    return MakeGreenEvaluator(*cage, Way::kLanes);
  }
};

}  // namespace

std::unique_ptr<const LaneEvaluator> MakeGreenEvaluator(const Cage& cage,
                                                        Way way) {
  return std::make_unique<GreenEvaluator>(cage, way);
}

const CoordinateScheme& GreenScheme() {
  static const Green scheme;
  return scheme;
}

}  // namespace deform
