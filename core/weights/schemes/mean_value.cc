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
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/weights/cage_faces.h"
#include "core/weights/scheme.h"

namespace deform {
namespace {

using Weights = std::span<double>;
using Face = CageFaces::Face;

// So far, in units of the largest coordinate, a point on a face may be off it
// by rounding.
constexpr double kOnCage = 1e-15;

// Adds to `weights` what eta has by a directed edge of a 2D cage.
void AddEdge(const Face& edge, const Vec3& eta, Weights weights) {
  const Vec3 a = edge.position[1] - edge.position[0];
  const Vec3 b1 = edge.position[0] - eta;
  const Vec3 b2 = edge.position[1] - eta;
  const double r1 = b1.norm();
  const double r2 = b2.norm();
  const double cross = (r1 < r2 ? b1 : b2).cross(a).z();
  const double dot = b1.dot(b2);
  // tan of half the angle under which the edge is seen.
  const double tangent =
      dot >= 0 ? cross / (r1 * r2 + dot) : (r1 * r2 - dot) / cross;
  weights[edge.corner[0]] += tangent / r1;
  weights[edge.corner[1]] += tangent / r2;
}

// What one edge of a triangle contributes; the edge is opposite corner q.
struct EdgeView {
  double d;       // Distance of eta from the edge's line within the plane, > 0
                  // on the inner side.
  double x1, x2;  // Its ends along its direction, from eta's foot.
  double delta;   // Distance of eta from its line.
  double theta;   // Angle under which it is seen.
};

// S = (sum theta d / delta) / h. Over the face all terms are positive; beside
// it, close to its plane, they cancel: there what they are in the plane, which
// is 0 in sum, is subtracted from each.
double PlaneSum(const std::array<EdgeView, 3>& edges, double h, double size) {
  const bool over = std::all_of(edges.begin(), edges.end(),
                                [](const EdgeView& e) { return e.d > 0; });
  double sum = 0;
  if (over || std::abs(h) >= 0.05 * size) {
    for (const EdgeView& e : edges) sum += e.theta * (e.d / e.delta);
    return sum / h;
  }
  const double h2 = h * h;
  for (const EdgeView& e : edges) {
    const double d = std::abs(e.d);
    // atan(x / d) - atan(x / delta)
    const auto more = [&](double x) {
      return std::atan2(x * h2, (e.delta + d) * (d * e.delta + x * x));
    };
    const double missing =
        e.theta * h2 / (e.delta * (e.delta + d)) + more(e.x2) - more(e.x1);
    sum += e.d > 0 ? -missing : missing;
  }
  return sum / h;
}

// Adds to `weights` what eta has by a triangle of a 3D cage.
void AddTriangle(const Face& face, const Vec3& eta, Weights weights) {
  std::array<Vec3, 3> a;
  std::array<double, 3> r;
  for (int k = 0; k < 3; ++k) {
    a[k] = face.position[k] - eta;
    r[k] = a[k].norm();
  }
  const auto nearest = std::min_element(r.begin(), r.end()) - r.begin();
  const double size = *std::max_element(r.begin(), r.end());
  const double h = face.normal.dot(a[nearest]);
  // In its plane, outside it, a face is seen edge on.
  if (std::abs(h) <= 4e-16 * size) return;
  std::array<EdgeView, 3> edges;
  for (int k = 0; k < 3; ++k) {
    const int from = (k + 1) % 3;
    const int to = (k + 2) % 3;
    const Vec3 edge = face.position[to] - face.position[from];
    const double l = edge.norm();
    EdgeView& e = edges[k];
    e.d = face.m[k].dot(a[r[from] < r[to] ? from : to]);
    e.x1 = edge.dot(a[from]) / l;
    e.x2 = edge.dot(a[to]) / l;
    e.delta = std::hypot(e.d, h);
    e.theta = std::atan2(e.delta * l, e.delta * e.delta + e.x1 * e.x2);
  }
  const double sum = PlaneSum(edges, h, size);
  for (int k = 0; k < 3; ++k) {
    double across = 0;
    for (int q = 0; q < 3; ++q) {
      across += edges[q].theta / edges[q].delta * face.m[k].dot(face.m[q]);
    }
    weights[face.corner[k]] += (edges[k].d * sum + h * across) / face.height[k];
  }
}

class MeanValueEvaluator final : public WeightEvaluator {
 public:
  explicit MeanValueEvaluator(const Cage& cage)
      : faces_(cage),
        vertices_(cage.vertex_count()),
        largest_coordinate_(cage.vertices().cwiseAbs().maxCoeff()) {}

  void Evaluate(const PositionsRef& points, WeightBlock& block) const override {
    const int64_t n = points.rows();
    block.vertex.setZero(n, vertices_);
    block.normal.resize(n, 0);
    block.states.resize(static_cast<size_t>(n));
    block.iterations.clear();
    block.residuals.clear();
    for (int64_t i = 0; i < n; ++i) {
      const Weights row(block.vertex.row(i).data(),
                        static_cast<size_t>(vertices_));
      block.states[i] = EvaluatePoint(points.row(i), row);
    }
  }

 private:
  PointState EvaluatePoint(const Vec3& eta, Weights weights) const {
    if (const auto touched = Touched(eta)) {
      const Face& face = faces_[touched->face];
      for (int k = 0; k < faces_.corners(); ++k) {
        weights[face.corner[k]] = touched->barycentric[k];
      }
      return PointState::kBoundary;
    }
    double sum = 0;
    for (int64_t f = 0; f < faces_.size(); ++f) {
      if (faces_.corners() == 2) {
        AddEdge(faces_[f], eta, weights);
      } else {
        AddTriangle(faces_[f], eta, weights);
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

  // The face that eta lies on, if any.
  std::optional<CageFaces::Nearest> Touched(const Vec3& eta) const {
    const double tolerance =
        kOnCage * std::max(largest_coordinate_, eta.cwiseAbs().maxCoeff());
    for (int64_t f = 0; f < faces_.size(); ++f) {
      if (!(std::abs(faces_.Height(f, eta)) <= tolerance)) continue;
      const CageFaces::Nearest nearest = faces_.NearestOn(f, eta);
      if (nearest.distance <= tolerance) return nearest;
    }
    return std::nullopt;
  }

  CageFaces faces_;
  int64_t vertices_;
  double largest_coordinate_;
};

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
  return std::make_unique<MeanValueEvaluator>(*cage);
}

}  // namespace

const CoordinateScheme& MeanValueScheme() {
  static const MeanValue scheme;
  return scheme;
}

}  // namespace deform
