// The closed shape around a model whose vertices are posed.
#pragma once

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"
#include "core/mesh/types.h"

namespace deform {

// 3D: closed, oriented triangle mesh, counter-clockwise seen from outside; any
// genus. 2D: closed oriented loops with the domain on the left (holes
// clockwise). Several components are allowed, also nested ones as cavities.
// Immutable and right: who holds a Cage need not check it again.
class Cage {
 public:
  enum class Orientation { kAsGiven, kFlipIfInsideOut };

  // `vertices` is V x 3 (third column 0 in 2D), `faces` F x dimension. Refuses
  // with InvalidArgument, naming the face, edge or vertex:
  //   EMPTY_CAGE, BAD_DIMENSION, NON_FINITE, COORDINATE_TOO_LARGE, NOT_PLANAR,
  //   INDEX_OUT_OF_RANGE
  //   DEGENERATE_FACE           zero area or length, or a corner twice
  //   CAGE_NOT_CLOSED           an edge (2D: a vertex) has one face only
  //   CAGE_NOT_MANIFOLD         an edge has three, or a vertex several fans
  //   CAGE_INCONSISTENT_ORIENTATION  neighbours disagree
  //   CAGE_INVERTED             inside out; kFlipIfInsideOut turns all faces
  //   CAGE_OVERLAPPING          faces cross, parts overlap, or one is inverted:
  //                             a face has not the inside on one side only
  static absl::StatusOr<Cage> Create(
      int dimension, Positions vertices, Faces faces,
      Orientation orientation = Orientation::kAsGiven);

  int dimension() const { return dimension_; }
  int64_t vertex_count() const { return vertices_.rows(); }
  int64_t face_count() const { return faces_.rows(); }
  const Positions& vertices() const { return vertices_; }
  const Faces& faces() const { return faces_; }
  // Diagonal of the bounding box, D.
  double diagonal() const { return diagonal_; }

 private:
  Cage(int dimension, Positions vertices, Faces faces);

  int dimension_;
  Positions vertices_;
  Faces faces_;
  double diagonal_;
};

// How often the cage winds around `point`: 1 inside, 0 outside, between on the
// boundary (the interior angle fraction).
double WindingNumber(const Cage& cage, const Vec3& point);

}  // namespace deform
