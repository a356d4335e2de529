#include "core/weights/schemes/celestial_evaluator.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <new>
#include <span>
#include <utility>

#include "core/weights/schemes/celestial_lanes.h"

namespace deform {
namespace {

// `count` doubles, aligned for any vector.
class AlignedDoubles {
 public:
  explicit AlignedDoubles(int64_t count)
      : data_(static_cast<double*>(std::aligned_alloc(
            64,
            (static_cast<size_t>(count) * sizeof(double) + 63) / 64 * 64))) {
    if (data_ == nullptr) throw std::bad_alloc();
    std::fill(data_.get(), data_.get() + count, 0.0);
  }
  double* get() const { return data_.get(); }
  double& operator[](int64_t i) const { return data_.get()[i]; }

 private:
  struct Free {
    void operator()(double* data) const { std::free(data); }
  };
  std::unique_ptr<double, Free> data_;
};

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

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;

// Solves runs of an order of points, as many points at a time as there are
// lanes, each from where the one before it ended.
class LaneGroup {
 public:
  // `s` are the user weights of T-CC, or null. Borrows both.
  LaneGroup(const Columns& handles, const double* s)
      : lanes_(CelestialLanes()),
        scratch_(8 * lanes_ * handles.rows()),
        weights_(lanes_ * handles.rows()),
        solution_(3 * lanes_),
        places_(3 * lanes_),
        job_{.handles = handles.rows(),
             .x = handles.col(0).data(),
             .y = handles.col(1).data(),
             .z = handles.col(2).data(),
             .s = s,
             .points = places_.get(),
             .scratch = scratch_.get(),
             .weights = weights_.get(),
             .solution = solution_.get()} {}

  int lanes() const { return lanes_; }
  int steps() const { return job_.steps; }
  bool solved(int lane) const { return job_.solved >> lane & 1; }

  // The points `run`, at least one; the last fills what is left of the lanes.
  void Solve(const PositionsRef& points, std::span<const int32_t> run) {
    for (int lane = 0; lane < lanes_; ++lane) {
      const int64_t i = run[std::min<size_t>(lane, run.size() - 1)];
      for (int d = 0; d < 3; ++d) {
        places_[d * lanes_ + lane] = points(i, d);
        solution_[d * lanes_ + lane] = start_[d];
      }
    }
    SolveCelestialLanes(job_);
    for (int d = 0; d < 3; ++d) {
      start_[d] = solved(lanes_ - 1) ? solution_[(d + 1) * lanes_ - 1] : 0;
    }
  }

  void CopyWeights(int lane, std::span<double> row) const {
    for (size_t k = 0; k < row.size(); ++k)
      row[k] = weights_[k * lanes_ + lane];
  }

 private:
  int lanes_;
  AlignedDoubles scratch_, weights_, solution_, places_;
  CelestialLaneJob job_;
  Vec3 start_ = Vec3::Zero();
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
    if (n == 0) return;
    const std::vector<int32_t> order = Ordered(points);
    if (way_ == CelestialWay::kLanes) {
      EvaluateLanes(points, order, block);
      return;
    }
    Directions directions;
    directions.Resize(handles_.rows());
    WideVec3 start = WideVec3::Zero();
    for (const int32_t i : order) {
      start = EvaluatePoint(i, points.row(i), start, directions, block);
    }
  }

 private:
  void EvaluateLanes(const PositionsRef& points, std::span<const int32_t> order,
                     WeightBlock& block) const {
    LaneGroup group(columns_,
                    kind_ == CelestialKind::kScaling ? nullptr : s_.data());
    Directions directions;
    directions.Resize(handles_.rows());
    WideVec3 start = WideVec3::Zero();  // For those that lanes do not solve.
    while (!order.empty()) {
      const auto run =
          order.first(std::min<size_t>(group.lanes(), order.size()));
      order = order.subspan(run.size());
      group.Solve(points, run);
      for (int lane = 0; lane < std::ssize(run); ++lane) {
        const int32_t i = run[lane];
        if (group.solved(lane)) {
          group.CopyWeights(lane, RowOf(block, i));
          block.iterations[i] = static_cast<uint16_t>(group.steps());
        } else {
          start = EvaluatePoint(i, points.row(i), start, directions, block);
        }
      }
    }
  }

  std::span<double> RowOf(WeightBlock& block, int64_t i) const {
    return {block.vertex.row(i).data(), static_cast<size_t>(handles_.rows())};
  }

  // Returns where the search ended: a start for the next.
  WideVec3 EvaluatePoint(int64_t i, const Vec3& point, const WideVec3& start,
                         Directions& directions, WeightBlock& block) const {
    const std::span<double> row = RowOf(block, i);
    if (!LookFrom(point, directions)) {
      SitOnHandle(point, row);
      return WideVec3::Zero();
    }
    const CelestialPoint solved =
        SolveCelestial(kind_, directions, s_, Uncertainty(point), start, row);
    block.states[i] = solved.state;
    block.iterations[i] =
        static_cast<uint16_t>(std::min(solved.iterations, 0xffff));
    return solved.y;
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
  Columns columns_;  // The same by columns.
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
