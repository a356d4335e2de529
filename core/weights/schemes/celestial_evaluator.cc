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

// Points that are solved at once, one a lane.
class LaneGroup {
 public:
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;

  // Borrows the handles and their user weights, which S-CC does not read.
  LaneGroup(CelestialKind kind, const Columns& handles,
            const std::vector<double>& s)
      : scratch_(8 * lanes_ * handles.rows()),
        weights_(lanes_ * handles.rows()),
        solution_(3 * lanes_),
        residual_(lanes_),
        points_(3 * lanes_),
        job_{.handles = handles.rows(),
             .x = handles.col(0).data(),
             .y = handles.col(1).data(),
             .z = handles.col(2).data(),
             .s = kind == CelestialKind::kScaling ? nullptr : s.data(),
             .points = points_.get(),
             .scratch = scratch_.get(),
             .weights = weights_.get(),
             .solution = solution_.get(),
             .residual = residual_.get()} {}

  int lanes() const { return lanes_; }

  void Put(int lane, const Vec3& point, const Vec3& start) {
    for (int d = 0; d < 3; ++d) {
      points_[d * lanes_ + lane] = point[d];
      solution_[d * lanes_ + lane] = start[d];
    }
  }

  void Solve() { SolveCelestialLanes(job_); }

  // After Solve(), of a lane:
  bool solved(int lane) const { return (job_.solved >> lane & 1) != 0; }
  Vec3 solution(int lane) const {
    return {solution_[lane], solution_[lanes_ + lane],
            solution_[2 * lanes_ + lane]};
  }
  // Writes what was found for a solved lane as point i.
  void Take(int lane, int64_t i, WeightBlock& block) const {
    double* const row = block.vertex.row(i).data();
    for (int64_t k = 0; k < job_.handles; ++k) {
      row[k] = weights_[k * lanes_ + lane];
    }
    block.iterations[i] = static_cast<uint16_t>(job_.steps);
    block.residuals[i] = residual_[lane];
    block.solutions.row(i) = solution(lane).cast<float>().transpose();
  }

 private:
  const int lanes_ = CelestialLanes();
  const AlignedArray<double> scratch_;
  const AlignedArray<double> weights_;
  const AlignedArray<double> solution_;
  const AlignedArray<double> residual_;
  const AlignedArray<double> points_;
  CelestialLaneJob job_;
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
    LaneGroup group(kind_, columns_, s_);
    Directions directions;
    directions.Resize(handles_.rows());
    Starts starts(block.known);
    Starts hard(block.known);  // Of plain searches.
    const auto n = std::ssize(order);
    for (int64_t first = 0; first < n; first += group.lanes()) {
      // The last point fills what is left of its group.
      const auto point_of = [&](int lane) {
        return order[std::min(first + lane, n - 1)];
      };
      for (int lane = 0; lane < group.lanes(); ++lane) {
        const int32_t i = point_of(lane);
        group.Put(lane, points.row(i), starts.For(i));
      }
      group.Solve();
      for (int lane = 0; lane < group.lanes() && first + lane < n; ++lane) {
        const int32_t i = point_of(lane);
        if (group.solved(lane)) {
          group.Take(lane, i, block);
        } else {
          EvaluatePoint(i, points.row(i), hard, directions, block);
        }
      }
      // All of the next group start from the point just before them.
      const int last = group.lanes() - 1;
      starts.Learn(point_of(last), group.solved(last) ? group.solution(last)
                                                      : Vec3(Vec3::Zero()));
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
  LaneGroup::Columns columns_;  // The same by columns.
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
