#include "client/verify/pose_columns.h"

#include "core/base/status_macros.h"

namespace deform {

absl::StatusOr<CaseColumns> CaseColumns::Create(const GoldenCase& golden) {
  DEFORM_ASSIGN_OR_RETURN(const Rig rig, RigOf(golden.rig));
  const PosedColumns posed(rig, golden.uses_normals());
  CaseColumns result;
  result.vertex_count_ = posed.vertex_count();
  result.rest_ = posed.rest();
  for (const GoldenDeformation& deformation : golden.deformations) {
    const double blend = deformation.stretch_blend;
    Columns columns(posed.count(), 3);
    posed.UpdateAll({deformation.vertices, blend}, columns);
    result.posed_.push_back(std::move(columns));
    std::vector<double>& stretch = result.stretch_.emplace_back();
    for (int64_t f = 0; f < posed.count() - posed.vertex_count(); ++f) {
      stretch.push_back(blend * posed.Stretch(deformation.vertices, f) +
                        (1 - blend));
    }
  }
  return result;
}

Vec3 CaseColumns::Deform(const Vec3& point, const std::vector<double>& weights,
                         size_t deformation) const {
  Vec3 moved = Vec3::Zero();
  for (int64_t c = 0; c < count(); ++c) {
    moved +=
        weights[c] * (posed_[deformation].row(c) - rest_.row(c)).transpose();
  }
  return point + moved;
}

Vec3 CaseColumns::ReproductionError(const Vec3& point,
                                    const std::vector<double>& weights) const {
  Vec3 error = Vec3::Zero();
  double sum = -1;
  for (int64_t c = 0; c < count(); ++c) {
    const bool vertex = c < vertex_count_;
    if (vertex) sum += weights[c];
    const Vec3 from = vertex ? point : Vec3::Zero();
    error += weights[c] * (rest_.row(c).transpose() - from);
  }
  return error + sum * point;
}

}  // namespace deform
