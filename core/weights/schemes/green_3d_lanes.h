// Green coordinates of the 16 points of a tile at once, one per vector lane:
// the way of the many points that are not close to the cage. Says which points
// it did not solve; those go the plain way (green_3d.cc), which also judges it.
//
// Pointers and counts only.
#pragma once

#include <cstdint>

#include "core/weights/schemes/lane_points.h"

namespace deform {

// As Face in green_3d.cc.
template <typename T>
struct GreenLaneFace {
  int32_t corner[3];
  int32_t edge[3];
  T normal[3];
  T m[3][3];
  T length[3];
  T cosine[3];
  T phi[3];  // length / (8 pi area)
  T area2;
  T psi;  // 1 / 4 pi, in model units.
};

template <typename T>
struct GreenLaneEdge {
  int32_t from, to;
  T length;
};

// A cage as the kernels read it. Lengths are in a unit in which it measures
// about 1, but for psi.
struct GreenLaneCage {
  int64_t vertices, edges, faces;
  const double* vertex;  // V x 3
  const GreenLaneEdge<double>* edge;
  const GreenLaneFace<double>* face;
  // The same in float, for what is far.
  const GreenLaneEdge<float>* far_edge;
  const GreenLaneFace<float>* far_face;
  const uint8_t* thin;  // F: 1 for faces that are never left to float.
  double touch;  // Closer to a face than this, a point goes the plain way.
};

// Of the kernels below, whichever needs more.
int64_t Green3dLaneScratch(const GreenLaneCage& cage);

// Writes phi and psi as (V + F) x 16, aligned to 64 bytes, closed: phi of
// solved lanes sums to 1 inside and to 0 outside. `points` in the cage's unit;
// `scratch` is aligned to 64 bytes.
//
// In double: to 1e-12. What the sum of phi misses is far less and is spread
// over all vertices.
void IntegrateGreen3d(const GreenLaneCage& cage, LanePoints& points,
                      void* scratch, double* weights);
// Faces far from all lanes in float, near ones in double: to 1e-6.
void IntegrateGreen3d(const GreenLaneCage& cage, LanePoints& points,
                      void* scratch, float* weights);

}  // namespace deform
