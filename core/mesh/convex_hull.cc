// Source: Barber, Dobkin, Huhdanpaa, "The Quickhull Algorithm for Convex
//   Hulls", ACM TOMS 22(4), 1996.
// Departs: points within a tolerance of a plane count as on it, so that
//   coplanar points are no special case.
#include "core/mesh/convex_hull.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <numeric>
#include <utility>

#include <Eigen/Geometry>

namespace deform {
namespace {

constexpr double kTolerance = 1e-12;

struct Facet {
  int64_t corner[3];  // Counter-clockwise seen from outside.
  HullPlane plane;
  std::vector<int64_t> outside;  // Points beyond it that no other has.
  bool alive = true;
};

class Quickhull {
 public:
  explicit Quickhull(const PositionsRef& points)
      : points_(points),
        tolerance_(kTolerance *
                   (points.colwise().maxCoeff() - points.colwise().minCoeff())
                       .norm()) {}

  std::vector<HullPlane> Run() {
    Begin();
    for (size_t f = 0; f < facets_.size(); ++f) {
      // New facets come behind, so that all are visited.
      if (facets_[f].alive && !facets_[f].outside.empty()) {
        AddPoint(Farthest(facets_[f]));
      }
    }
    std::vector<HullPlane> planes;
    for (const Facet& facet : facets_) {
      if (facet.alive && Supports(facet)) planes.push_back(facet.plane);
    }
    return planes;
  }

 private:
  Vec3 At(int64_t i) const { return points_.row(i); }
  double Height(const Facet& facet, int64_t i) const {
    return facet.plane.Height(At(i));
  }
  // False for slivers among coplanar points, whose normal is rounding: their
  // neighbours have the plane.
  bool Supports(const Facet& facet) const {
    if (facet.plane.normal.isZero(0)) return false;
    for (int64_t i = 0; i < points_.rows(); ++i) {
      if (Height(facet, i) > 2 * tolerance_) return false;
    }
    return true;
  }

  int64_t Farthest(const Facet& facet) const {
    return *std::max_element(facet.outside.begin(), facet.outside.end(),
                             [&](int64_t a, int64_t b) {
                               return Height(facet, a) < Height(facet, b);
                             });
  }

  int64_t AddFacet(int64_t a, int64_t b, int64_t c) {
    Facet facet{.corner = {a, b, c}};
    facet.plane = {(At(b) - At(a)).cross(At(c) - At(a)).normalized(), At(a)};
    facets_.push_back(std::move(facet));
    return std::ssize(facets_) - 1;
  }

  // A large tetrahedron.
  void Begin() {
    int64_t corner[4] = {0, 0, 0, 0};
    const auto farthest = [&](auto measure) {
      int64_t best = 0;
      for (int64_t i = 1; i < points_.rows(); ++i) {
        if (measure(i) > measure(best)) best = i;
      }
      return best;
    };
    corner[0] = farthest([&](int64_t i) { return points_(i, 0); });
    const Vec3 a = At(corner[0]);
    corner[1] = farthest([&](int64_t i) { return (At(i) - a).norm(); });
    const Vec3 ab = (At(corner[1]) - a).normalized();
    corner[2] =
        farthest([&](int64_t i) { return (At(i) - a).cross(ab).norm(); });
    const Vec3 normal = ab.cross(At(corner[2]) - a).normalized();
    corner[3] =
        farthest([&](int64_t i) { return std::abs((At(i) - a).dot(normal)); });
    if ((At(corner[3]) - a).dot(normal) > 0) std::swap(corner[1], corner[2]);
    AddFacet(corner[0], corner[1], corner[2]);
    AddFacet(corner[0], corner[3], corner[1]);
    AddFacet(corner[1], corner[3], corner[2]);
    AddFacet(corner[2], corner[3], corner[0]);
    std::vector<int64_t> all(points_.rows());
    std::iota(all.begin(), all.end(), 0);
    Distribute(all, 0);
  }

  // Gives points to the first facet, from `first` on, that they lie beyond;
  // drops those within all.
  void Distribute(const std::vector<int64_t>& points, size_t first) {
    for (const int64_t i : points) {
      for (size_t f = first; f < facets_.size(); ++f) {
        if (!(Height(facets_[f], i) > tolerance_)) continue;
        facets_[f].outside.push_back(i);
        break;
      }
    }
  }

  // Replaces the facets that see the point by a fan from their outline.
  void AddPoint(int64_t point) {
    std::map<std::pair<int64_t, int64_t>, int> edges;
    std::vector<int64_t> orphans;
    for (Facet& facet : facets_) {
      if (!facet.alive || !(Height(facet, point) > tolerance_)) continue;
      facet.alive = false;
      for (int k = 0; k < 3; ++k) {
        ++edges[{facet.corner[k], facet.corner[(k + 1) % 3]}];
      }
      orphans.insert(orphans.end(), facet.outside.begin(), facet.outside.end());
      facet.outside.clear();
    }
    const size_t first = facets_.size();
    for (const auto& [edge, count] : edges) {
      if (edges.contains({edge.second, edge.first})) continue;
      AddFacet(edge.first, edge.second, point);
    }
    std::erase(orphans, point);
    Distribute(orphans, first);
  }

  const PositionsRef points_;
  const double tolerance_;
  std::vector<Facet> facets_;
};

double Turn(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (b - a).cross(c - a).z();
}

// Andrew's monotone chain, counter-clockwise.
std::vector<HullPlane> HullLines(const PositionsRef& points) {
  std::vector<Vec3> sorted(points.rows());
  for (int64_t i = 0; i < points.rows(); ++i) sorted[i] = points.row(i);
  std::sort(sorted.begin(), sorted.end(), [](const Vec3& a, const Vec3& b) {
    return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
  });
  std::vector<Vec3> chain;
  const auto extend = [&](const Vec3& point, size_t keep) {
    while (chain.size() >= keep + 2 &&
           Turn(chain[chain.size() - 2], chain.back(), point) <= 0) {
      chain.pop_back();
    }
    chain.push_back(point);
  };
  for (const Vec3& point : sorted) extend(point, 0);
  const size_t lower = chain.size() - 1;
  for (size_t i = sorted.size() - 1; i-- > 0;) extend(sorted[i], lower);
  std::vector<HullPlane> lines;
  for (size_t k = 0; k + 1 < chain.size(); ++k) {
    const Vec3 t = chain[k + 1] - chain[k];
    if (t.isZero(0)) continue;
    lines.push_back({Vec3(t.y(), -t.x(), 0).normalized(), chain[k]});
  }
  return lines;
}

}  // namespace

std::vector<HullPlane> HullPlanes(const PositionsRef& points, int dimension) {
  return dimension == 2 ? HullLines(points) : Quickhull(points).Run();
}

}  // namespace deform
