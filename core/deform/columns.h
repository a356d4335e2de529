// What the weights are applied to: one row per weight column.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/deform/pose.h"
#include "core/mesh/rig.h"
#include "core/weights/binding.h"
#include "core/weights/scheme.h"

namespace deform {

// x -> linear x + offset.
struct AffineMap {
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Vec3 offset = Vec3::Zero();
  Vec3 operator()(const Vec3& x) const { return linear * x + offset; }
};

// The similarity (rotation, uniform scale, translation; never a reflection)
// that maps `rest` to `posed` best in the least-squares sense; in 2D within the
// plane. The identity if the rows are equal to the last bit. Source: Umeyama
// 1991.
AffineMap FitSimilarity(const Positions& rest, const Positions& posed,
                        int dimension);

// Stretch of a face: [L08] Eq. 13 in 2D, Eq. 14 in 3D, in the form of MATH
// section 2 that does not cancel for thin faces. `rest`, `posed`: corners.
double Stretch2d(const Vec3 rest[2], const Vec3 posed[2]);
double Stretch3d(const Vec3 rest[3], const Vec3 posed[3]);

// The columns of a rig: V posed vertices, then, if the scheme uses normals, F
// scaled posed normals s_b n'. A face that degenerates keeps the direction it
// had in `columns` before.
class PosedColumns {
 public:
  PosedColumns(const Rig& rig, bool uses_normals);

  int64_t count() const { return vertex_count_ + face_count_; }

  // C x 3 of the rest pose: vertices, unit normals.
  const RowMatrix& rest() const { return rest_; }

  // Rewrites the columns that depend on `moved` vertices (empty span: on none)
  // and appends their indices, vertices first, to `changed`, which is sorted
  // and free of repeats if it was empty.
  void Update(const Pose& pose, std::span<const int32_t> moved,
              RowMatrix& columns, std::vector<int32_t>& changed) const;
  // Rewrites all columns.
  void UpdateAll(const Pose& pose, RowMatrix& columns) const;

 private:
  void UpdateNormal(const Pose& pose, int64_t face, RowMatrix& columns) const;

  int dimension_;
  int64_t vertex_count_;
  int64_t face_count_ = 0;  // 0 if normals are not used.
  Faces faces_;
  RowMatrix rest_;
  // Faces around vertex v: incident_[first_[v] .. first_[v + 1]).
  std::vector<int32_t> first_;
  std::vector<int32_t> incident_;
};

// How far the crossed faces of a part are from moving by the same similarity as
// its exit face, as a fraction of the exit face's stretch: the larger of the
// difference of the linear maps (Frobenius norm) and the distance between where
// the exit face's map puts a crossed face's corner and where it is, in units of
// D. The extension is smooth where this is 0 ([L08] section 4.2).
double ExitMismatch(const Cage& cage, const std::vector<ExitPart>& parts,
                    const RowMatrix& columns);

}  // namespace deform
