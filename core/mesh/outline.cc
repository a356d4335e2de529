#include "core/mesh/outline.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "core/mesh/side.h"
#include "core/mesh/triangle.h"

namespace deform {
namespace {

// Vertices where edges of a surface pass through the plane.
class Cuts {
 public:
  Cuts(const Positions& positions, double level)
      : positions_(positions), level_(level) {}

  bool Above(int32_t vertex) const { return positions_(vertex, 2) > level_; }

  int32_t On(int32_t a, int32_t b) {
    const auto [entry, is_new] = index_.try_emplace(
        std::minmax(a, b), static_cast<int32_t>(points_.size()));
    if (is_new) {
      const Vec3 from = positions_.row(std::min(a, b));
      const Vec3 to = positions_.row(std::max(a, b));
      Vec3 point =
          from + (level_ - from.z()) / (to.z() - from.z()) * (to - from);
      point.z() = 0;
      points_.push_back(point);
    }
    return entry->second;
  }

  const std::vector<Vec3>& points() const { return points_; }

 private:
  const Positions& positions_;
  const double level_;
  std::map<std::pair<int32_t, int32_t>, int32_t> index_;
  std::vector<Vec3> points_;
};

Outline MakeOutline(const std::vector<Vec3>& points,
                    const std::vector<std::array<int32_t, 2>>& edges) {
  Outline outline{Positions(points.size(), 3), Faces(edges.size(), 2)};
  for (size_t i = 0; i < points.size(); ++i) {
    outline.positions.row(i) = points[i];
  }
  for (size_t e = 0; e < edges.size(); ++e) {
    outline.edges.row(e) << edges[e][0], edges[e][1];
  }
  return outline;
}

// An outline that loses vertices.
class Simplifier {
 public:
  using Allows = absl::FunctionRef<bool(const Vec3&, const Vec3&, const Vec3&)>;

  Simplifier(const Outline& outline, Allows allows)
      : allows_(allows),
        next_(outline.positions.rows()),
        before_(outline.positions.rows()) {
    for (const auto& row : outline.positions.rowwise()) {
      points_.emplace_back(row);
    }
    for (const auto& edge : outline.edges.rowwise()) {
      next_[edge[0]] = edge[1];
      before_[edge[1]] = edge[0];
    }
    alive_.resize(points_.size());
    for (int32_t v = 0; v < static_cast<int32_t>(points_.size()); ++v) {
      alive_[v] = v;
    }
    for (const int32_t v : alive_) cost_.push_back(CostOf(v));
  }

  void Run(int64_t target) {
    while (static_cast<int64_t>(alive_.size()) > target) {
      const auto cheapest = std::min_element(
          alive_.begin(), alive_.end(),
          [&](int32_t a, int32_t b) { return cost_[a] < cost_[b]; });
      if (cost_[*cheapest] == kNever) return;
      const int32_t before = before_[*cheapest];
      const int32_t next = next_[*cheapest];
      if (next_[next] == before) {  // Three are left of its loop.
        cost_[*cheapest] = kNever;
        continue;
      }
      alive_.erase(cheapest);
      next_[before] = next;
      before_[next] = before;
      cost_[before] = CostOf(before);
      cost_[next] = CostOf(next);
    }
  }

  Outline Result() const {
    std::vector<Vec3> points;
    std::vector<int32_t> index(points_.size());
    for (const int32_t v : alive_) {
      index[v] = static_cast<int32_t>(points.size());
      points.push_back(points_[v]);
    }
    std::vector<std::array<int32_t, 2>> edges;
    for (const int32_t v : alive_) edges.push_back({index[v], index[next_[v]]});
    return MakeOutline(points, edges);
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  double CostOf(int32_t v) const {
    const int32_t a = before_[v];
    const int32_t b = next_[v];
    const Vec3 &pa = points_[a], &pv = points_[v], &pb = points_[b];
    if (!allows_(pa, pv, pb)) return kNever;
    for (const int32_t other : alive_) {
      if (other == a || other == v || other == b) continue;
      if (Holds(pa, pv, pb, points_[other])) return kNever;
    }
    return (ClosestOnSegment(pv, pa, pb) - pv).norm();
  }

  // Whether the triangle, turned either way, holds `p`, its border included.
  static bool Holds(const Vec3& a, const Vec3& b, const Vec3& c,
                    const Vec3& p) {
    const auto [low, high] = std::minmax(
        {SideOfLine(a, b, p), SideOfLine(b, c, p), SideOfLine(c, a, p)});
    return low >= 0 || high <= 0;
  }

  const Allows allows_;
  std::vector<Vec3> points_;
  std::vector<int32_t> next_;
  std::vector<int32_t> before_;
  std::vector<int32_t> alive_;  // Sorted.
  std::vector<double> cost_;
};

}  // namespace

Outline Slice(const TriangleSurface& surface, double level) {
  Cuts cuts(surface.positions, level);
  std::vector<std::array<int32_t, 2>> edges;
  for (const auto& face : surface.faces.rowwise()) {
    // Seen from outside with z up, the way down lies left of the way up: an
    // edge from the one to the other has the inside on its left.
    int32_t down = -1;
    int32_t up = -1;
    for (int k = 0; k < 3; ++k) {
      const int32_t a = face[k];
      const int32_t b = face[(k + 1) % 3];
      if (cuts.Above(a) == cuts.Above(b)) continue;
      (cuts.Above(a) ? down : up) = cuts.On(a, b);
    }
    if (down >= 0) edges.push_back({down, up});
  }
  return MakeOutline(cuts.points(), edges);
}

Outline Simplify(
    const Outline& outline, int64_t target_edges,
    absl::FunctionRef<bool(const Vec3&, const Vec3&, const Vec3&)> allows) {
  Simplifier simplifier(outline, allows);
  simplifier.Run(target_edges);
  return simplifier.Result();
}

}  // namespace deform
