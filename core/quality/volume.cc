#include "core/quality/volume.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/mesh/mesh.h"

namespace deform {
namespace {

using Edge = std::pair<int32_t, int32_t>;

// The directed edges of triangles, sorted.
std::vector<Edge> EdgesOf(const Faces& faces) {
  std::vector<Edge> edges;
  edges.reserve(faces.size());
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      edges.push_back({faces(f, k), faces(f, (k + 1) % 3)});
    }
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

// Edges without a neighbour, turned, so that they run around what closes them.
std::vector<Edge> RimsOf(const std::vector<Edge>& edges) {
  std::vector<Edge> rims;
  for (const Edge& edge : edges) {
    const Edge turned(edge.second, edge.first);
    if (!std::binary_search(edges.begin(), edges.end(), turned)) {
      rims.push_back(turned);
    }
  }
  return rims;
}

// Gives vertices that edges connect the same representative.
class Components {
 public:
  explicit Components(int64_t vertices) : parent_(vertices) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int32_t Find(int32_t v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }
  void Join(int32_t a, int32_t b) { parent_[Find(a)] = Find(b); }

 private:
  std::vector<int32_t> parent_;
};

// Six times the volume between the rims and the origin of `at`, with fans.
template <typename At>
double CapVolume(const std::vector<Edge>& rims, int64_t vertices, At at) {
  Components components(vertices);
  for (const Edge& edge : rims) components.Join(edge.first, edge.second);
  struct Rim {
    Vec3 sum = Vec3::Zero();
    int64_t count = 0;
  };
  std::map<int32_t, Rim> middles;
  for (const Edge& edge : rims) {
    Rim& rim = middles[components.Find(edge.first)];
    rim.sum += at(edge.first);
    ++rim.count;
  }
  double volume = 0;
  for (const Edge& edge : rims) {
    const Rim& rim = middles[components.Find(edge.first)];
    const Vec3 middle = rim.sum / static_cast<double>(rim.count);
    volume += middle.dot(at(edge.first).cross(at(edge.second)));
  }
  return volume;
}

}  // namespace

VolumeKind VolumeKindOf(const Faces& faces, int dimension) {
  if (faces.rows() == 0) return VolumeKind::kNone;
  if (dimension == 2) return VolumeKind::kArea;
  const std::vector<Edge> edges = EdgesOf(faces);
  // An edge that two faces run through alike.
  if (std::adjacent_find(edges.begin(), edges.end()) != edges.end()) {
    return VolumeKind::kNone;
  }
  return RimsOf(edges).empty() ? VolumeKind::kClosed : VolumeKind::kCapped;
}

double VolumeOf(VolumeKind kind, const PositionsRef& positions,
                const Faces& faces) {
  if (kind == VolumeKind::kNone) return 0;
  // From the middle, which keeps the digits of models far from the origin.
  const Vec3 center = BoxOf(positions).center();
  const auto at = [&](int32_t v) {
    return Vec3(positions.row(v).transpose() - center);
  };
  double sum = 0;
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Vec3 a = at(faces(f, 0)), b = at(faces(f, 1)), c = at(faces(f, 2));
    sum += kind == VolumeKind::kArea ? (b - a).cross(c - a).z()
                                     : a.dot(b.cross(c));
  }
  if (kind == VolumeKind::kArea) return sum / 2;
  if (kind == VolumeKind::kCapped) {
    sum += CapVolume(RimsOf(EdgesOf(faces)), positions.rows(), at);
  }
  return sum / 6;
}

}  // namespace deform
