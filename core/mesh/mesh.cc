#include "core/mesh/mesh.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {

Box BoxOf(const PositionsRef& positions) {
  if (positions.rows() == 0) return {};
  return {positions.colwise().minCoeff().transpose(),
          positions.colwise().maxCoeff().transpose()};
}

absl::Status CheckPositions(const PositionsRef& positions,
                            absl::string_view what, absl::string_view field) {
  for (int64_t i = 0; i < positions.rows(); ++i) {
    if (!positions.row(i).allFinite()) {
      return InvalidInput(
          "NON_FINITE", field,
          absl::StrCat(what, " ", i, " has a coordinate that is not finite"));
    }
    if (positions.row(i).cwiseAbs().maxCoeff() > kMaxCoordinate) {
      return InvalidInput(
          "COORDINATE_TOO_LARGE", field,
          absl::StrCat(what, " ", i, " has a coordinate beyond ",
                       kMaxCoordinate));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckIndices(const Faces& faces, int64_t vertices,
                          absl::string_view field) {
  for (int64_t f = 0; f < faces.rows(); ++f) {
    for (int k = 0; k < faces.cols(); ++k) {
      if (faces(f, k) < 0 || faces(f, k) >= vertices) {
        return InvalidInput("INDEX_OUT_OF_RANGE", field,
                            absl::StrCat("face ", f, " refers to vertex ",
                                         faces(f, k), " of ", vertices));
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Mesh> Mesh::Create(int dimension, Positions positions,
                                  Faces faces) {
  if (dimension != 2 && dimension != 3) {
    return InvalidInput(
        "BAD_DIMENSION", "header.dimension",
        absl::StrCat("dimension must be 2 or 3, not ", dimension));
  }
  if (positions.rows() == 0) {
    return InvalidInput("EMPTY_MODEL", "header.vertex_count",
                        "a model needs at least one vertex");
  }
  DEFORM_RETURN_IF_ERROR(CheckPositions(positions, "vertex", "chunk.data"));
  if (dimension == 2 && !(positions.col(2).array() == 0).all()) {
    return InvalidInput("NOT_PLANAR", "chunk.data",
                        "a 2D model must lie in the plane z = 0");
  }
  if (faces.rows() > 0 && faces.cols() != 3) {
    return InvalidInput("BAD_FACES", "chunk.data",
                        "faces of a model are triangles");
  }
  DEFORM_RETURN_IF_ERROR(CheckIndices(faces, positions.rows(), "chunk.data"));
  return Mesh(dimension, std::move(positions), std::move(faces));
}

Mesh::Mesh(int dimension, Positions positions, Faces faces)
    : dimension_(dimension),
      positions_(std::move(positions)),
      faces_(std::move(faces)),
      box_(BoxOf(positions_)) {}

}  // namespace deform
