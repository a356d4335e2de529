// Mean value coordinates of the 16 points of a tile at once, one per vector
// lane, in the plane and in space; mean_value.cc judges it, and takes what it
// leaves: points next to the cage, and faces that are seen nearly edge on.
//
// Pointers and counts only. All in double; memory is aligned to 64 bytes.
#pragma once

#include <cstdint>

#include "core/weights/schemes/lane_points.h"

namespace deform {

struct MeanValueEdge {
  int32_t from, to;
  double a[3];  // to - from
  double length;
};

// Corner q lies opposite edge q, as in CageFaces.
struct MeanValueFace {
  int32_t corner[3];
  int32_t edge[3];
  double normal[3];
  double m[3][3];
  double cosine[3];          // m_{q+1} . m_{q+2}
  double inverse_height[3];  // Of corner q above edge q.
};

// A cage as the kernels read it; without faces it is 2D.
struct MeanValueCage {
  int64_t vertices, edges, faces;
  const double* vertex;  // V x 3
  const MeanValueEdge* edge;
  const MeanValueFace* face;
  double size;   // D
  double touch;  // Closer to the cage than this, a point goes the plain way.
};

int64_t MeanValueScratch(const MeanValueCage& cage);

// First step: sums the weights, V x 16, of all edges (2D) or faces (3D). A bit
// of skew[f] says that the face is seen so nearly edge on by that lane, to
// within `edge_on` of its farthest corner, that its share was left out; 2D does
// not use it. Sets points.solved for lanes that did not touch the cage.
void SumMeanValues(const MeanValueCage& cage, LanePoints& points,
                   double edge_on, void* scratch, double* weights,
                   uint32_t* skew);

// Second step: makes them sum to 1. Solved are lanes whose weights reproduce
// the point to `tolerance`, in units of D.
void NormaliseMeanValues(const MeanValueCage& cage, LanePoints& points,
                         double tolerance, double* weights);
// The same rounded into `rounded`.
void NormaliseMeanValues(const MeanValueCage& cage, LanePoints& points,
                         double tolerance, double* weights, float* rounded);

}  // namespace deform
