// The model that is deformed.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/mesh/types.h"

namespace deform {

// Coordinates are refused beyond this magnitude: products of three of them stay
// finite.
inline constexpr double kMaxCoordinate = 1e100;

// Bounding box. Empty boxes have diagonal 0.
struct Box {
  Vec3 min = Vec3::Zero();
  Vec3 max = Vec3::Zero();
  double diagonal() const { return (max - min).norm(); }
  Vec3 center() const { return 0.5 * (min + max); }
};

Box BoxOf(const PositionsRef& positions);

// Refusals shared by models, cages, handles and poses. `what` begins the
// message ("vertex", "handle"), `field` names the request's field.
//
// NON_FINITE:          "vertex 3 has a coordinate that is not finite"
// COORDINATE_TOO_LARGE
absl::Status CheckPositions(const PositionsRef& positions,
                            absl::string_view what, absl::string_view field);
// INDEX_OUT_OF_RANGE:  "face 3 refers to vertex 8 of 8"
absl::Status CheckIndices(const Faces& faces, int64_t vertices,
                          absl::string_view field);

// N points in 2D or 3D, with triangles or without. Immutable and right.
class Mesh {
 public:
  // `dimension` is 2 or 3; `faces` is F x 3, F may be 0. Refuses, besides what
  // the checks above do, a model without points (EMPTY_MODEL), another
  // dimension (BAD_DIMENSION) and 2D points off the plane z = 0 (NOT_PLANAR).
  // Faces may be anything that refers to points: models are as they come.
  static absl::StatusOr<Mesh> Create(int dimension, Positions positions,
                                     Faces faces);

  int dimension() const { return dimension_; }
  int64_t size() const { return positions_.rows(); }
  const Positions& positions() const { return positions_; }
  const Faces& faces() const { return faces_; }
  const Box& box() const { return box_; }

 private:
  Mesh(int dimension, Positions positions, Faces faces);

  int dimension_;
  Positions positions_;
  Faces faces_;
  Box box_;
};

}  // namespace deform
