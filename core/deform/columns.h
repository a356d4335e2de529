// What the weights are applied to: one row per weight column.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/deform/pose.h"
#include "core/mesh/rig.h"
#include "core/mesh/types.h"
#include "core/weights/exit_regions.h"

namespace deform {

// C x 3: V posed vertices (model units), then, for schemes that use normals, F
// posed normals scaled by their face's stretch (no unit).
using Columns = Positions;

// The rest shape of a face, and what posing needs of it. Of an edge in 2D, of
// a triangle in 3D.
struct FaceFrame {
  int32_t corner[3];  // In 3D from `corner[0]`, the shortest edge goes to [1].
  Vec3 normal;        // Unit, outward.
  // 2D: 1 / length^2, unused, unused. 3D, with u the shortest edge and v the
  // other one from corner[0]: 1 / u.u, 1 / height^2, and u.v / u.u.
  double inverse_u2 = 0;
  double inverse_w2 = 0;
  double shear = 0;
};

// The columns of a rig.
class PosedColumns {
 public:
  PosedColumns(const Rig& rig, bool uses_normals);

  int64_t count() const { return rest_.rows(); }
  int64_t vertex_count() const { return vertex_count_; }

  // Columns of the rest pose: vertices and unit normals.
  const Columns& rest() const { return rest_; }

  // Stretch s_j of a face in `vertices`: [L08] Eq. 13 (2D) and 14 (3D), the
  // latter as the Frobenius norm of the map in an orthonormal frame of the rest
  // face, which does not cancel for thin faces.
  double Stretch(const Positions& vertices, int64_t face) const;

  // Rewrites all columns.
  void UpdateAll(const Pose& pose, Columns& columns) const;

  // Rewrites the columns that depend on `moved` vertices and returns their
  // indices, sorted: the moved vertices, then the faces incident to them.
  std::vector<int32_t> Update(const Pose& pose, std::span<const int32_t> moved,
                              Columns& columns) const;

 private:
  // The scaled normal s_b n' of a face. Of a face that degenerates to a segment
  // or point n' has no direction of its own: the rest normal turned
  // perpendicular to the longest edge that is left is taken.
  Vec3 ScaledNormal(const Pose& pose, int64_t face) const;

  int dimension_;
  int64_t vertex_count_;
  std::vector<FaceFrame> faces_;  // Empty if normals are not used.
  Columns rest_;
  // Faces around vertex v: incident_[first_[v] .. first_[v + 1]).
  std::vector<int32_t> first_;
  std::vector<int32_t> incident_;
};

// How far the crossed faces of outside parts are from moving by the same
// similarity as their exit face, as a fraction of the exit face's stretch: the
// larger of the difference of the two linear maps (Frobenius norm) and of the
// distance, in units of D, between a crossed face's posed corner and where the
// exit face's map puts it. The extension is smooth where this is 0 ([L08]
// section 4.2). `columns` are those of a scheme that uses normals.
double ExitMismatch(const Cage& cage, const std::vector<ExitPart>& parts,
                    const PosedColumns& posed, const Columns& columns);

}  // namespace deform
