#include "core/deform/pose.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {

Pose RestPose(const Rig& rig) { return {.vertices = RestVertices(rig)}; }

namespace {

absl::Status CheckIndices(const std::vector<int32_t>& indices,
                          const PoseShape& shape) {
  const int64_t moving = shape.rows;
  for (size_t i = 0; i < indices.size(); ++i) {
    const int32_t vertex = indices[i];
    if (vertex >= 0 && vertex < moving) continue;
    if (vertex >= 0 && vertex < moving + shape.fixed) {
      return InvalidInput(
          "FIXED_HANDLE", "pose.vertices",
          absl::StrCat("pose entry ", i, " moves handle ", vertex,
                       ", which is fixed, as all from ", moving, " on"));
    }
    return InvalidInput("INDEX_OUT_OF_RANGE", "pose.vertices",
                        absl::StrCat("pose entry ", i, " refers to vertex ",
                                     vertex, " of ", moving));
  }
  return absl::OkStatus();
}

}  // namespace

PoseShape ShapeOf(const Rig& rig) {
  const int64_t rows = PoseRows(rig);
  return {.dimension = DimensionOf(rig),
          .rows = rows,
          .fixed = RestVertices(rig).rows() - rows};
}

absl::Status CheckPoseUpdate(const PoseUpdate& update, const PoseShape& shape) {
  const int64_t vertices = shape.rows;
  const int64_t named = static_cast<int64_t>(update.vertices.size());
  const int64_t expected = named == 0 ? vertices : named;
  // A change of the blend alone moves no vertex.
  const bool blend_only =
      named == 0 && update.positions.rows() == 0 && update.stretch_blend;
  if (update.positions.rows() != expected && !blend_only) {
    return InvalidInput(
        "WRONG_LENGTH", "pose.positions",
        absl::StrCat("pose has ", update.positions.rows(), " positions, but ",
                     named == 0 ? "the rig has " : "names ", expected,
                     " vertices"));
  }
  DEFORM_RETURN_IF_ERROR(CheckIndices(update.vertices, shape));
  DEFORM_RETURN_IF_ERROR(
      CheckPositions(update.positions, "pose entry", "pose.positions"));
  // Of no rows there is no column either.
  if (shape.dimension == 2 && update.positions.rows() > 0 &&
      !(update.positions.col(2).array() == 0).all()) {
    return InvalidInput("NOT_PLANAR", "pose.positions",
                        "a 2D pose must lie in the plane z = 0");
  }
  if (const auto blend = update.stretch_blend;
      blend && !(*blend >= 0 && *blend <= 1)) {
    return InvalidInput(
        "STRETCH_BLEND_OUT_OF_RANGE", "pose.stretch_blend",
        absl::StrCat("stretch blend must be in [0, 1], not ", *blend));
  }
  return absl::OkStatus();
}

void ApplyPoseUpdate(const PoseUpdate& update, Pose& pose) {
  if (update.stretch_blend) pose.stretch_blend = *update.stretch_blend;
  if (update.vertices.empty()) {
    pose.vertices.topRows(update.positions.rows()) = update.positions;
    return;
  }
  for (size_t i = 0; i < update.vertices.size(); ++i) {
    pose.vertices.row(update.vertices[i]) = update.positions.row(i);
  }
}

}  // namespace deform
