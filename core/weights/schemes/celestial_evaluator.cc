#include "core/weights/schemes/celestial_evaluator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "core/base/aligned_array.h"
#include "core/weights/schemes/celestial_lanes.h"

namespace deform {
namespace {

// The points of a block along a space-filling curve, so that each is near the
// one before it, where its search starts.
std::vector<int32_t> Ordered(const PositionsRef& points) {
  const Box box = BoxOf(points);
  const double side = (box.max - box.min).maxCoeff();
  const double scale = side > 0 ? 1023 / side : 0;
  // Ten bits of each coordinate, interleaved, above the index.
  std::vector<uint64_t> keys(static_cast<size_t>(points.rows()));
  for (int64_t i = 0; i < points.rows(); ++i) {
    uint32_t key = 0;
    for (int d = 0; d < 3; ++d) {
      auto bits = static_cast<uint32_t>((points(i, d) - box.min[d]) * scale);
      bits = (bits | bits << 16) & 0x030000ff;
      bits = (bits | bits << 8) & 0x0300f00f;
      bits = (bits | bits << 4) & 0x030c30c3;
      bits = (bits | bits << 2) & 0x09249249;
      key |= bits << d;
    }
    keys[i] = uint64_t{key} << 32 | static_cast<uint32_t>(i);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<int32_t> order(keys.size());
  for (size_t k = 0; k < keys.size(); ++k) {
    order[k] = static_cast<int32_t>(keys[k] & 0xffffffff);
  }
  return order;
}

// Where searches start: where that of the point before ended, or, with known
// solutions of a similar rig, at the point's own, carried along by as much as
// the one of the point before was off. Whichever would have been nearer for
// the point before is taken, so that known solutions do not mislead for long.
class Starts {
 public:
  explicit Starts(const Solutions& known) : known_(known) {}

  Vec3 For(int64_t i) const {
    return trusted_ && Knows(i) ? Vec3(Known(i) + shift_) : last_;
  }

  // The search of point i ended at `y`; 0 if it has no solution.
  void Learn(int64_t i, const Vec3& y) {
    if (Knows(i) && !y.isZero(0)) {
      const Vec3 shift = y - Known(i);
      trusted_ = (shift - shift_).squaredNorm() <= (y - last_).squaredNorm();
      shift_ = shift;
    }
    last_ = y;
  }

 private:
  bool Knows(int64_t i) const {
    return known_.rows() > 0 && !known_.row(i).isZero(0);
  }
  Vec3 Known(int64_t i) const {
    return known_.row(i).cast<double>().transpose();
  }

  const Solutions& known_;
  Vec3 last_ = Vec3::Zero();
  Vec3 shift_ = Vec3::Zero();
  bool trusted_ = true;
};

class CelestialEvaluator final : public WeightEvaluator {
 public:
  CelestialEvaluator(CelestialKind kind, const Handles& handles,
                     std::vector<double> s, CelestialWay way)
      : kind_(kind),
        way_(way),
        handles_(handles.positions()),
        columns_(handles_),
        s_(std::move(s)),
        largest_coordinate_(handles_.cwiseAbs().maxCoeff()) {
    s_.resize(static_cast<size_t>(handles_.rows()), 0.0);
  }

  void Evaluate(const PositionsRef& points, WeightBlock& block) const override {
    const int64_t n = points.rows();
    block.vertex.resize(n, handles_.rows());
    block.normal.resize(n, 0);
    block.states.assign(static_cast<size_t>(n), PointState::kInside);
    block.iterations.assign(static_cast<size_t>(n), 0);
    block.residuals.assign(static_cast<size_t>(n), 0.0);
    block.solutions.setZero(n, 3);
    if (n == 0) return;
    const std::vector<int32_t> order = Ordered(points);
    if (way_ == CelestialWay::kLanes) {
      EvaluateLanes(points, order, block);
      return;
    }
    Directions directions;
    directions.Resize(handles_.rows());
    Starts starts(block.known);
    for (const int32_t i : order) {
      EvaluatePoint(i, points.row(i), starts, directions, block);
    }
  }

 private:
  void EvaluateLanes(const PositionsRef& points, std::span<const int32_t> order,
                     WeightBlock& block) const {
    const int64_t handles = handles_.rows();
    const int lanes = CelestialLanes();
    const AlignedArray<double> scratch(8 * lanes * handles);
    const AlignedArray<double> weights(lanes * handles);
    const AlignedArray<double> solution(3 * lanes);
    const AlignedArray<double> residual(lanes);
    const AlignedArray<double> places(3 * lanes);
    CelestialLaneJob job = {
        .handles = handles,
        .x = columns_.col(0).data(),
        .y = columns_.col(1).data(),
        .z = columns_.col(2).data(),
        .s = kind_ == CelestialKind::kScaling ? nullptr : s_.data(),
        .points = places.get(),
        .scratch = scratch.get(),
        .weights = weights.get(),
        .solution = solution.get(),
        .residual = residual.get()};
    Directions directions;
    directions.Resize(handles);
    Starts starts(block.known);
    Starts hard(block.known);  // Of plain searches.
    const auto n = std::ssize(order);
    for (int64_t first = 0; first < n; first += lanes) {
      for (int lane = 0; lane < lanes; ++lane) {
        // The last point fills what is left of its group.
        const int32_t i = order[std::min(first + lane, n - 1)];
        const Vec3 start = starts.For(i);
        for (int d = 0; d < 3; ++d) {
          places[d * lanes + lane] = points(i, d);
          solution[d * lanes + lane] = start[d];
        }
      }
      SolveCelestialLanes(job);
      for (int lane = 0; lane < std::min<int64_t>(lanes, n - first); ++lane) {
        const int32_t i = order[first + lane];
        if (job.solved >> lane & 1) {
          double* row = block.vertex.row(i).data();
          for (int64_t k = 0; k < handles; ++k) {
            row[k] = weights[k * lanes + lane];
          }
          block.iterations[i] = static_cast<uint16_t>(job.steps);
          block.residuals[i] = residual[lane];
          for (int d = 0; d < 3; ++d) {
            block.solutions(i, d) =
                static_cast<float>(solution[d * lanes + lane]);
          }
          continue;
        }
        EvaluatePoint(i, points.row(i), hard, directions, block);
      }
      // All of the next group start from the point just before them.
      const int last = lanes - 1;
      Vec3 y = Vec3::Zero();
      for (int d = 0; d < 3 && (job.solved >> last & 1) != 0; ++d) {
        y[d] = solution[d * lanes + last];
      }
      starts.Learn(order[std::min(first + last, n - 1)], y);
    }
  }

  void EvaluatePoint(int64_t i, const Vec3& point, Starts& starts,
                     Directions& directions, WeightBlock& block) const {
    const std::span<double> row(block.vertex.row(i).data(),
                                static_cast<size_t>(handles_.rows()));
    if (!LookFrom(point, directions)) {
      SitOnHandle(point, row);
      starts.Learn(i, Vec3::Zero());
      return;
    }
    const CelestialPoint solved =
        SolveCelestial(kind_, directions, s_, Uncertainty(point),
                       starts.For(i).cast<long double>(), row);
    block.states[i] = solved.state;
    block.iterations[i] =
        static_cast<uint16_t>(std::min(solved.iterations, 0xffff));
    block.residuals[i] = solved.residual;
    block.solutions.row(i) = solved.y.cast<float>().transpose();
    starts.Learn(i, solved.y.cast<double>());
  }

  // Returns false if the point is at a handle.
  bool LookFrom(const Vec3& point, Directions& directions) const {
    for (int64_t k = 0; k < handles_.rows(); ++k) {
      if (!directions.Set(k, handles_.row(k).transpose() - point)) return false;
    }
    return true;
  }

  // Both schemes interpolate. Of coincident handles only the sum is defined:
  // they share equally.
  void SitOnHandle(const Vec3& point, std::span<double> row) const {
    int64_t sharers = 0;
    for (int64_t k = 0; k < handles_.rows(); ++k) {
      if (handles_.row(k).transpose() == point) ++sharers;
    }
    for (int64_t k = 0; k < handles_.rows(); ++k) {
      row[k] = handles_.row(k).transpose() == point ? 1.0 / sharers : 0;
    }
  }

  // A point that was computed to lie on the hull is off by so much.
  double Uncertainty(const Vec3& point) const {
    return 8 * std::numeric_limits<double>::epsilon() *
           std::max(largest_coordinate_, point.cwiseAbs().maxCoeff());
  }

  CelestialKind kind_;
  CelestialWay way_;
  Positions handles_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> columns_;  // The same by columns.
  std::vector<double> s_;
  double largest_coordinate_;
};

}  // namespace

std::unique_ptr<const WeightEvaluator> MakeCelestialEvaluator(
    CelestialKind kind, const Handles& handles, std::vector<double> s,
    CelestialWay way) {
  return std::make_unique<CelestialEvaluator>(kind, handles, std::move(s), way);
}

}  // namespace deform
