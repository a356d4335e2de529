#include "core/weights/schemes/celestial_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "core/weights/schemes/celestial_hull.h"

namespace deform {
namespace {

// A search that ended above this is tried in another way ...
constexpr double kGoodResidual = 1e-9;
// ... and refused above this.
constexpr double kWorstResidual = 1e-7;
// When the largest weight is so many times the smallest, the point may lie
// exactly on the hull: the search converges there too, at infinity.
constexpr double kHullContrast = 1e13;

class PointSolver {
 public:
  PointSolver(CelestialKind kind, const Directions& q,
              std::span<const double> s, double tolerance)
      : kind_(kind), q_(q), s_(s), tolerance_(tolerance) {
    heavy_ = kind_ == CelestialKind::kTranslation &&
             std::any_of(s.begin(), s.end(), [](double v) { return v > 0; });
  }

  CelestialPoint Solve(const WideVec3& start, std::span<double> weights) {
    std::fill(weights.begin(), weights.end(), 0);
    NewtonSolution solution = Search(s_, start);
    if (heavy_ && !Good(solution)) return SolveHeavy(solution, weights);
    if (!Good(solution) && !start.isZero(0))
      solution = Search(s_, WideVec3::Zero());
    return Finish(solution, weights);
  }

 private:
  static bool Good(const NewtonSolution& solution) {
    return !solution.separated() && solution.residual <= kGoodResidual;
  }

  NewtonSolution Search(std::span<const double> s, const WideVec3& start) {
    const NewtonSolution solution =
        kind_ == CelestialKind::kScaling
            ? Minimize(q_, AsinhPotential(), start)
            : Minimize(q_, ExponentialPotential{s.data()}, start);
    steps_ += solution.iterations;
    return solution;
  }

  // T-CC with user weights, where the search for `solution` failed: near the
  // hull the potential is flat to the last digit. Without user weights it is
  // not: that tells whether the point is inside, and where to start.
  CelestialPoint SolveHeavy(NewtonSolution solution,
                            std::span<double> weights) {
    if (solution.separated()) return Finish(solution, weights);
    const std::vector<double> none(s_.size(), 0.0);
    const NewtonSolution light = Search(none, WideVec3::Zero());
    if (light.separated()) return Finish(light, weights);
    Spread(none, light.y, weights);
    if (auto point =
            TryHull(light.y.cast<double>(), InsideTolerance(), weights)) {
      return *point;
    }
    const auto keep_better = [&](const NewtonSolution& next) {
      if (!next.separated() && next.residual < solution.residual) {
        solution = next;
      }
    };
    keep_better(Search(s_, light.y));
    if (!Good(solution)) {
      WideVec3 y = light.y;
      for (int k = 15; k >= 1; --k) {
        y = Search(Scaled(std::ldexp(1.0, -2 * k)), y).y;
      }
      keep_better(Search(s_, y));
    }
    return Finish(solution, weights);
  }

  std::vector<double> Scaled(double factor) const {
    std::vector<double> s(s_.begin(), s_.end());
    for (double& v : s) v *= factor;
    return s;
  }

  CelestialPoint Finish(const NewtonSolution& solution,
                        std::span<double> weights) {
    Spread(s_, solution.y, weights);
    if (solution.separated()) {
      return Outside(solution.separator, weights);
    }
    const auto [least, most] =
        std::minmax_element(weights.begin(), weights.end());
    if (*most > kHullContrast * *least) {
      auto point =
          TryHull(solution.y.cast<double>(), InsideTolerance(), weights);
      if (point) return *point;
      Spread(s_, solution.y, weights);
    }
    if (!(solution.residual <= kWorstResidual)) {
      std::fill(weights.begin(), weights.end(), 0);
      return {PointState::kNotConverged, steps_};
    }
    return {PointState::kInside, steps_, solution.y, solution.residual};
  }

  // A plane with normal `separator` has all handles on its far side. Unless
  // nearer than rounding, that is final.
  CelestialPoint Outside(const Vec3& separator, std::span<double> weights) {
    double gap = std::numeric_limits<double>::infinity();
    for (int64_t i = 0; i < q_.size(); ++i) {
      gap = std::min(gap, -q_.q(i).dot(separator) * q_.distance[i]);
    }
    if (gap <= tolerance_ * separator.norm()) {
      auto point = TryHull(separator, tolerance_, weights);
      if (point) return *point;
    }
    std::fill(weights.begin(), weights.end(), 0);
    return {PointState::kOutsideHull, steps_};
  }

  // The limit on the hull, if the point is on it. Reads `weights` as a hint and
  // overwrites them if so.
  std::optional<CelestialPoint> TryHull(const Vec3& outward, double tolerance,
                                        std::span<double> weights) {
    const auto face = FindHullFace(q_, weights, outward, tolerance);
    if (!face) return std::nullopt;
    std::fill(weights.begin(), weights.end(), 0);
    std::vector<double> s;
    double s_elsewhere = 0;
    for (int64_t i = 0, k = 0; i < q_.size(); ++i) {
      if (k < std::ssize(face->handles) && face->handles[k] == i) {
        s.push_back(s_[i]);
        ++k;
      } else {
        s_elsewhere = std::max(s_elsewhere, s_[i]);
      }
    }
    if (heavy_ && s_elsewhere > 0) {
      return CelestialPoint{PointState::kOutsideHull, steps_};
    }
    std::vector<double> on_face(s.size());
    CelestialPoint point = SolveCelestial(kind_, face->directions, s, tolerance,
                                          WideVec3::Zero(), on_face);
    for (size_t k = 0; k < on_face.size(); ++k) {
      weights[face->handles[k]] = on_face[k];
    }
    if (point.state == PointState::kInside) point.state = PointState::kBoundary;
    point.iterations += steps_;
    point.y.setZero();  // It belongs to the face.
    return point;
  }

  // Rounding of the directions themselves.
  double InsideTolerance() const {
    const double farthest =
        *std::max_element(q_.distance.begin(), q_.distance.end());
    return 4 * std::numeric_limits<double>::epsilon() * farthest;
  }

  // weights_i = (beta_i / d_i) / sum, with d scaled by the least so that points
  // next to a handle do not overflow.
  void Spread(std::span<const double> s, const WideVec3& y,
              std::span<double> weights) const {
    const double nearest =
        *std::min_element(q_.distance.begin(), q_.distance.end());
    double sum = 0;
    for (int64_t i = 0; i < q_.size(); ++i) {
      const double u = Exponent(q_, i, y);
      const double beta = kind_ == CelestialKind::kScaling
                              ? AsinhPotential().At(i, u).beta
                              : ExponentialPotential{s.data()}.At(i, u).beta;
      weights[i] = beta * (nearest / q_.distance[i]);
      sum += weights[i];
    }
    for (double& weight : weights) weight /= sum;
  }

  CelestialKind kind_;
  const Directions& q_;
  std::span<const double> s_;
  double tolerance_;
  bool heavy_ = false;
  int steps_ = 0;
};

}  // namespace

CelestialPoint SolveCelestial(CelestialKind kind, const Directions& directions,
                              std::span<const double> s, double tolerance,
                              const WideVec3& start,
                              std::span<double> weights) {
  return PointSolver(kind, directions, s, tolerance).Solve(start, weights);
}

}  // namespace deform
