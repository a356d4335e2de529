#include "core/deform/deformer.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/kernels/apply_weights.h"
#include "core/kernels/weight_tiles.h"

namespace deform {
namespace {

// Tiles that one body of a parallel loop walks: some milliseconds at most, and
// sums that fit the second cache.
constexpr int64_t kTilesPerBlock = 256;
// Below this many products a loop is not worth sharing among threads.
constexpr int64_t kParallelProducts = 1 << 18;
// Sums gather a rounding of 1e-16 D a step; after so many they are made anew.
constexpr int kMaxSteps = 4096;

}  // namespace

Deformer::Deformer(std::shared_ptr<const Binding> binding, ThreadPool* pool)
    : binding_(std::move(binding)),
      pool_(pool),
      posed_columns_(binding_->rig(), binding_->scheme().uses_normals()),
      pose_(RestPose(binding_->rig())),
      columns_(posed_columns_.rest()),
      displacement_(binding_->weights().tiles() * kTileSums, 0.0) {
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
    posed_columns_.UpdateAll(pose, columns_);
    map_ = FitSimilarity(RestVertices(binding_->rig()), pose_.vertices,
                         binding_->dimension());
    steps_since_full_ = 0;
    return change;
  }
  for (const int32_t c : change.columns) {
    for (int d = 0; d < 3; ++d) {
      change.deltas.push_back(next(c, d) - columns_(c, d));
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
  return report;
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
  // Adding a column costs about as much as applying one, and reads and writes
  // the sums besides.
  if (static_cast<int64_t>(changed.size()) * 2 > columns_.rows()) return true;
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

Vec3 Deformer::PointAt(int64_t point) const {
  const Vec3 rest = binding_->model()->positions().row(point).transpose();
  if (!fixed_.empty() && fixed_[point]) return rest;
  const double* sums = displacement_.data() + point / kTilePoints * kTileSums +
                       point % kTilePoints;
  return map_(rest) + Vec3(sums[0], sums[kTilePoints], sums[2 * kTilePoints]);
}

Positions Deformer::positions() const {
  Positions all(binding_->point_count(), 3);
  for (int64_t i = 0; i < all.rows(); ++i) all.row(i) = PointAt(i).transpose();
  return all;
}

void Deformer::CopyRelative(int64_t first, int64_t count, const Vec3& origin,
                            float* out) const {
  const int dimension = binding_->dimension();
  for (int64_t i = 0; i < count; ++i) {
    const Vec3 relative = PointAt(first + i) - origin;
    for (int d = 0; d < dimension; ++d) {
      out[i * dimension + d] = static_cast<float>(relative(d));
    }
  }
}

// The sums of several deformers of one binding, in one walk over its weights.
class JointPass {
 public:
  explicit JointPass(const WeightTiles& weights) : weights_(weights) {}

  void Add(Deformer& deformer, const Deformer::Change& change) {
    if (change.full) {
      full_.push_back(&deformer);
    } else if (!change.columns.empty()) {
      stepping_.emplace_back(&deformer, &change);
    }
  }

  void Run(ThreadPool* pool) {
    if (full_.empty() && stepping_.empty()) return;
    PackResiduals();
    const int64_t tiles = weights_.tiles();
    const int64_t blocks = (tiles + kTilesPerBlock - 1) / kTilesPerBlock;
    const int64_t products = tiles * kTilePoints * weights_.columns();
    const auto block = [&](int64_t b) {
      const int64_t first = b * kTilesPerBlock;
      const int64_t count = std::min(kTilesPerBlock, tiles - first);
      ApplyAll(first, count);
      ApplyChanges(first, count);
    };
    if (pool != nullptr && blocks > 1 && products > kParallelProducts) {
      pool->ParallelFor(blocks, nullptr, block);
    } else {
      for (int64_t b = 0; b < blocks; ++b) block(b);
    }
  }

 private:
  void PackResiduals() {
    residuals_.reserve(weights_.columns() * full_.size() * 3);
    for (int64_t c = 0; c < weights_.columns(); ++c) {
      for (const Deformer* deformer : full_) {
        const Vec3 residual = deformer->Residual(deformer->columns_, c);
        for (int d = 0; d < 3; ++d) {
          residuals_.push_back(static_cast<float>(residual(d)));
        }
      }
    }
  }

  void ApplyAll(int64_t first, int64_t count) const {
    const auto sets = static_cast<int64_t>(full_.size());
    if (sets == 0) return;
    std::vector<float> sums(count * sets * kTileSums);
    ApplyTiles(weights_.tile(first), count, weights_.columns(), sets,
               residuals_.data(), sums.data());
    for (int64_t s = 0; s < sets; ++s) {
      for (int64_t t = 0; t < count; ++t) {
        std::copy_n(sums.data() + (t * sets + s) * kTileSums, kTileSums,
                    full_[s]->displacement_.data() + (first + t) * kTileSums);
      }
    }
  }

  void ApplyChanges(int64_t first, int64_t count) const {
    for (const auto& [deformer, change] : stepping_) {
      AddTileColumns(weights_.tile(first), count, weights_.columns(),
                     change->columns.data(),
                     static_cast<int64_t>(change->columns.size()),
                     change->deltas.data(),
                     deformer->displacement_.data() + first * kTileSums);
    }
  }

  const WeightTiles& weights_;
  std::vector<Deformer*> full_;
  std::vector<float> residuals_;  // columns x full_ x 3
  std::vector<std::pair<Deformer*, const Deformer::Change*>> stepping_;
};

void MoveTogether(std::span<DeformJob> jobs, ThreadPool* pool) {
  if (jobs.empty()) return;
  std::vector<Deformer::Change> changes;
  changes.reserve(jobs.size());  // The pass points to them.
  JointPass pass(jobs.front().deformer->binding().weights());
  for (DeformJob& job : jobs) {
    assert(&job.deformer->binding() == &jobs.front().deformer->binding());
    changes.push_back(job.deformer->Begin(*job.pose, job.path));
    pass.Add(*job.deformer, changes.back());
  }
  pass.Run(pool);
  for (size_t k = 0; k < jobs.size(); ++k) {
    jobs[k].report = jobs[k].deformer->Report(changes[k]);
  }
}

}  // namespace deform
