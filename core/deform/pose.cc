#include "core/deform/pose.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {

Pose RestPose(const Rig& rig) { return {.vertices = RestVertices(rig)}; }

absl::Status CheckPoseUpdate(const PoseUpdate& update, const Rig& rig) {
  const int64_t vertices = RestVertices(rig).rows();
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
  for (int64_t i = 0; i < named; ++i) {
    if (update.vertices[i] < 0 || update.vertices[i] >= vertices) {
      return InvalidInput("INDEX_OUT_OF_RANGE", "pose.vertices",
                          absl::StrCat("pose entry ", i, " refers to vertex ",
                                       update.vertices[i], " of ", vertices));
    }
  }
  DEFORM_RETURN_IF_ERROR(
      CheckPositions(update.positions, "pose entry", "pose.positions"));
  // Of no rows there is no column either.
  if (DimensionOf(rig) == 2 && update.positions.rows() > 0 &&
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
    if (update.positions.rows() > 0) pose.vertices = update.positions;
    return;
  }
  for (size_t i = 0; i < update.vertices.size(); ++i) {
    pose.vertices.row(update.vertices[i]) = update.positions.row(i);
  }
}

}  // namespace deform
