#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/kernels/weight_tiles.h"
#include "core/mesh/rig.h"
#include "core/mesh/types.h"
#include "core/weights/cage_edges.h"
#include "core/weights/cage_faces.h"
#include "core/weights/schemes/green.h"
#include "core/weights/schemes/green_3d_lanes.h"
#include "core/weights/schemes/green_lanes.h"

namespace deform {
namespace {

using std::numbers::pi;

// Square of the longest edge over twice the area, above which terms that cancel
// within a face would lose too much to float.
constexpr double kThin = 16;
// Nearer to a face than this part of D, the plain way knows better.
constexpr double kTouch = 1e-10;

template <typename T>
GreenLaneFace<T> LaneFace(const CageFaces::Face& face,
                          const std::array<int32_t, 3>& edges, double scale) {
  GreenLaneFace<T> to;
  for (int q = 0; q < 3; ++q) {
    const int from = (q + 1) % 3, next = (q + 2) % 3;
    const double length =
        (face.position[next] - face.position[from]).norm() * scale;
    const double area2 = length * face.height[q] * scale;
    to.corner[q] = face.corner[q];
    to.edge[q] = edges[q];
    to.normal[q] = static_cast<T>(face.normal[q]);
    for (int d = 0; d < 3; ++d) to.m[q][d] = static_cast<T>(face.m[q][d]);
    to.length[q] = static_cast<T>(length);
    to.cosine[q] = static_cast<T>(face.m[from].dot(face.m[next]));
    to.phi[q] = static_cast<T>(length / (4 * pi * area2));
    to.area2 = static_cast<T>(area2);
  }
  // Infinite for lengths that float cannot hold, as are then the weights.
  const double psi = 1 / (4 * pi * scale);
  to.psi = sizeof(T) == sizeof(float) ? RoundedWeight(psi) : psi;
  return to;
}

bool IsThin(const GreenLaneFace<double>& face) {
  const double longest = *std::max_element(face.length, face.length + 3);
  return longest * longest > kThin * face.area2;
}

class Green3dLanes : public GreenLanes {
 public:
  explicit Green3dLanes(const Cage& cage);

  void Integrate(LanePoints& points, void* scratch,
                 double* weights) const override {
    IntegrateGreen3d(cage_, points, scratch, weights);
  }
  void Integrate(LanePoints& points, void* scratch,
                 float* weights) const override {
    IntegrateGreen3d(cage_, points, scratch, weights);
  }
  int64_t ScratchBytes() const override { return Green3dLaneScratch(cage_); }

 private:
  const double scale_;
  const Positions vertices_;
  std::vector<GreenLaneEdge<double>> edges_;
  std::vector<GreenLaneFace<double>> faces_;
  std::vector<GreenLaneEdge<float>> far_edges_;
  std::vector<GreenLaneFace<float>> far_faces_;
  std::vector<uint8_t> thin_;
  GreenLaneCage cage_;
};

Green3dLanes::Green3dLanes(const Cage& cage)
    : scale_(LaneScale(DiagonalOf(cage))), vertices_(cage.vertices() * scale_) {
  const CageEdges edges(cage);
  for (const CageEdges::Edge& edge : edges.edges) {
    const double length =
        (vertices_.row(edge.to) - vertices_.row(edge.from)).norm();
    edges_.push_back({edge.from, edge.to, length});
    far_edges_.push_back({edge.from, edge.to, static_cast<float>(length)});
  }
  const CageFaces faces(cage);
  for (int64_t f = 0; f < faces.size(); ++f) {
    faces_.push_back(LaneFace<double>(faces[f], edges.of_face[f], scale_));
    far_faces_.push_back(LaneFace<float>(faces[f], edges.of_face[f], scale_));
    thin_.push_back(IsThin(faces_.back()));
  }
  cage_ = {.vertices = vertices_.rows(),
           .edges = static_cast<int64_t>(edges_.size()),
           .faces = static_cast<int64_t>(faces_.size()),
           .vertex = vertices_.data(),
           .edge = edges_.data(),
           .face = faces_.data(),
           .far_edge = far_edges_.data(),
           .far_face = far_faces_.data(),
           .thin = thin_.data(),
           .touch = std::max(kTouch, 8 * BoundaryTolerance(cage) * scale_)};
}

}  // namespace

std::unique_ptr<const GreenLanes> MakeGreen3dLanes(const Cage& cage) {
  return std::make_unique<Green3dLanes>(cage);
}

}  // namespace deform
