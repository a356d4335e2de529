#include "core/weights/schemes/mean_value_lane_cage.h"

#include <algorithm>

#include "core/mesh/rig.h"
#include "core/weights/cage_edges.h"
#include "core/weights/cage_faces.h"

namespace deform {
namespace {

// Nearer to the cage than this part of D, the plain way knows better.
constexpr double kTouch = 1e-10;

MeanValueFace LaneFace(const CageFaces::Face& face,
                       const std::array<int32_t, 3>& edges) {
  MeanValueFace to;
  for (int q = 0; q < 3; ++q) {
    to.corner[q] = face.corner[q];
    to.edge[q] = edges[q];
    to.normal[q] = face.normal[q];
    for (int d = 0; d < 3; ++d) to.m[q][d] = face.m[q][d];
    to.cosine[q] = face.m[(q + 1) % 3].dot(face.m[(q + 2) % 3]);
    to.inverse_height[q] = 1 / face.height[q];
  }
  return to;
}

}  // namespace

MeanValueLaneCage::MeanValueLaneCage(const Cage& cage, double rounding)
    : vertices_(cage.vertices()) {
  if (cage.dimension() == 2) {
    for (int64_t e = 0; e < cage.face_count(); ++e) {
      AddEdge(cage.faces()(e, 0), cage.faces()(e, 1));
    }
  } else {
    const CageEdges edges(cage);
    for (const auto& [from, to] : edges.edges) AddEdge(from, to);
    const CageFaces faces(cage);
    for (int64_t f = 0; f < faces.size(); ++f) {
      faces_.push_back(LaneFace(faces[f], edges.of_face[f]));
    }
  }
  const double size = DiagonalOf(cage);
  cage_ = {.vertices = vertices_.rows(),
           .edges = static_cast<int64_t>(edges_.size()),
           .faces = static_cast<int64_t>(faces_.size()),
           .vertex = vertices_.data(),
           .edge = edges_.data(),
           .face = faces_.data(),
           .size = size,
           .touch = std::max(kTouch * size, 8 * rounding)};
}

void MeanValueLaneCage::AddEdge(int32_t from, int32_t to) {
  const Vec3 a = vertices_.row(to) - vertices_.row(from);
  edges_.push_back({from, to, {a.x(), a.y(), a.z()}, a.norm()});
}

}  // namespace deform
