#include "core/deform/deformer.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/weights/compress_binding.h"

namespace deform {
namespace {

// Sums gather a rounding of 1e-16 D a step; after so many they are made anew.
constexpr int kMaxSteps = 4096;

}  // namespace

Deformer::Deformer(std::shared_ptr<const Binding> binding, ThreadPool* pool,
                   Allowance& copies)
    : binding_(std::move(binding)),
      pool_(pool),
      posed_columns_(binding_->rig(), binding_->scheme().uses_normals()),
      pose_(RestPose(binding_->rig())),
      columns_(posed_columns_.rest()),
      sums_(WeightedSums::Create(*binding_, copies)) {
  if (binding_->compressed() != nullptr) pose_bounds_ = PoseBounds(*binding_);
  if (!binding_->fixed_points().empty()) {
    fixed_.assign(binding_->point_count(), 0);
    for (const int64_t point : binding_->fixed_points()) fixed_[point] = 1;
  }
}

DeformReport Deformer::MoveTo(const Pose& pose, Path path) {
  DeformJob job{.deformer = this, .pose = &pose, .path = path};
  MoveTogether({&job, 1}, pool_);
  return job.report;
}

Deformer::Change Deformer::Begin(const Pose& pose, Path path) {
  Change change;
  const std::vector<int32_t> moved = MovedVertices(pose);
  Columns next = columns_;
  change.columns = posed_columns_.Update(pose, moved, next);
  pose_ = pose;
  change.full = path == Path::kFull || PrefersFull(change.columns, next);
  if (change.full) {
    columns_ = std::move(next);
    map_ = FitSimilarity(RestVertices(binding_->rig()), pose_.vertices,
                         binding_->dimension());
    steps_since_full_ = 0;
    change.values.reserve(3 * columns_.rows());
    for (int64_t c = 0; c < columns_.rows(); ++c) {
      const Vec3 residual = Residual(columns_, c);
      change.values.insert(change.values.end(), residual.begin(),
                           residual.end());
    }
    return change;
  }
  for (const int32_t c : change.columns) {
    for (int d = 0; d < 3; ++d) {
      change.values.push_back(next(c, d) - columns_(c, d));
    }
  }
  columns_ = std::move(next);
  steps_since_full_ += change.columns.empty() ? 0 : 1;
  return change;
}

DeformReport Deformer::Report(const Change& change) const {
  DeformReport report;
  report.full = change.full;
  report.columns_applied = change.full
                               ? columns_.rows()
                               : static_cast<int64_t>(change.columns.size());
  if (const Cage* cage = std::get_if<Cage>(&binding_->rig());
      cage != nullptr && binding_->scheme().uses_normals()) {
    report.exit_mismatch =
        ExitMismatch(*cage, binding_->exit_parts(), posed_columns_, columns_);
  }
  if (const CompressedWeights* compressed = binding_->compressed()) {
    report.error_bound = compressed->bound() * LargestResidual();
  }
  return report;
}

double Deformer::LargestResidual() const {
  double largest = 0;
  for (int64_t c = 0; c < columns_.rows(); ++c) {
    largest = std::max(largest, Residual(columns_, c).norm() / pose_bounds_[c]);
  }
  return largest;
}

// The residual of column c: v' - T v, or s n' - A n.
Vec3 Deformer::Residual(const Columns& columns, int64_t c) const {
  const Vec3 rest = posed_columns_.rest().row(c).transpose();
  const Vec3 now = columns.row(c).transpose();
  return c < posed_columns_.vertex_count() ? Vec3(now - map_(rest))
                                           : Vec3(now - map_.linear * rest);
}

std::vector<int32_t> Deformer::MovedVertices(const Pose& pose) const {
  const bool all = pose.stretch_blend != pose_.stretch_blend;
  std::vector<int32_t> moved;
  for (int64_t v = 0; v < pose.vertices.rows(); ++v) {
    if (all || pose.vertices.row(v) != pose_.vertices.row(v)) {
      moved.push_back(static_cast<int32_t>(v));
    }
  }
  return moved;
}

bool Deformer::PrefersFull(const std::vector<int32_t>& changed,
                           const Columns& next) const {
  if (!sums_->PrefersAdding(changed)) return true;
  if (steps_since_full_ >= kMaxSteps) return true;
  // Float weights lose digits in proportion to the residuals. A fresh fit
  // leaves them within about the size of the pose; when steps have carried the
  // pose further off its map than that, fit it anew.
  const double limit = 2 * BoxOf(pose_.vertices).diagonal();
  for (int64_t v = 0; v < posed_columns_.vertex_count(); ++v) {
    if (!(Residual(next, v).norm() <= limit)) return true;
  }
  return false;
}

Positions Deformer::positions() const {
  Positions all(binding_->point_count(), 3);
  sums_->Copy(0, all.rows(), all.data());
  const Positions& rest = binding_->model()->positions();
  for (int64_t i = 0; i < all.rows(); ++i) {
    const Vec3 at = rest.row(i).transpose();
    const Vec3 displacement = all.row(i).transpose();
    all.row(i) = (is_fixed(i) ? at : Vec3(map_(at) + displacement)).transpose();
  }
  return all;
}

void Deformer::CopyRelative(int64_t first, int64_t count, const Vec3& origin,
                            float* out) const {
  constexpr int64_t kPoints = 256;
  double displacements[kPoints * 3];
  float flat[kPoints * 3];
  const PointMap map = PointMapOf(map_, origin);
  const Positions& rest = binding_->model()->positions();
  const int dimension = binding_->dimension();
  for (int64_t at = first; at < first + count; at += kPoints) {
    const int64_t some = std::min(kPoints, first + count - at);
    sums_->Copy(at, some, displacements);
    float* const points = dimension == 3 ? out : flat;
    MapPoints(map, rest.row(at).data(), displacements, some, points);
    for (int64_t i = 0; i < some && !fixed_.empty(); ++i) {
      if (!is_fixed(at + i)) continue;
      for (int d = 0; d < 3; ++d) {
        points[3 * i + d] = static_cast<float>(rest(at + i, d) - origin(d));
      }
    }
    for (int64_t i = 0; i < some && dimension == 2; ++i) {
      std::copy_n(flat + 3 * i, 2, out + 2 * i);
    }
    out += some * dimension;
  }
}

void MoveTogether(std::span<DeformJob> jobs, ThreadPool* pool) {
  if (jobs.empty()) return;
  const Binding& binding = jobs.front().deformer->binding();
  std::vector<Deformer::Change> changes;
  std::vector<SumsChange> of_sums;
  changes.reserve(jobs.size());  // The changes of the sums point into it.
  for (DeformJob& job : jobs) {
    assert(&job.deformer->binding() == &binding);
    const Deformer::Change& change =
        changes.emplace_back(job.deformer->Begin(*job.pose, job.path));
    if (!change.full && change.columns.empty()) continue;
    of_sums.push_back({.sums = job.deformer->sums_.get(),
                       .full = change.full,
                       .columns = change.columns,
                       .values = change.values});
  }
  ApplyChanges(binding, of_sums, pool);
  for (size_t k = 0; k < jobs.size(); ++k) {
    jobs[k].report = jobs[k].deformer->Report(changes[k]);
  }
}

}  // namespace deform
