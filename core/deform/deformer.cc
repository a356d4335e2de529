#include "core/deform/deformer.h"

#include <algorithm>
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

// The residual of column c under `map`: v' - T v, or s n' - A n.
Vec3 Residual(const AffineMap& map, const PosedColumns& posed,
              const Columns& columns, int64_t c) {
  const Vec3 rest = posed.rest().row(c).transpose();
  const Vec3 now = columns.row(c).transpose();
  return c < posed.vertex_count() ? Vec3(now - map(rest))
                                  : Vec3(now - map.linear * rest);
}

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
  const std::vector<int32_t> moved = MovedVertices(pose);
  Columns next = columns_;
  const std::vector<int32_t> changed = posed_columns_.Update(pose, moved, next);
  pose_ = pose;
  DeformReport report;
  report.full = path == Path::kFull || PrefersFull(changed, next);
  if (report.full) {
    posed_columns_.UpdateAll(pose, columns_);
    ApplyAll();
    report.columns_applied = columns_.rows();
  } else {
    ApplyChanged(changed, next);
    columns_ = std::move(next);
    report.columns_applied = static_cast<int64_t>(changed.size());
  }
  if (const Cage* cage = std::get_if<Cage>(&binding_->rig());
      cage != nullptr && binding_->scheme().uses_normals()) {
    report.exit_mismatch =
        ExitMismatch(*cage, binding_->exit_parts(), posed_columns_, columns_);
  }
  return report;
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
    if (!(Residual(map_, posed_columns_, next, v).norm() <= limit)) return true;
  }
  return false;
}

void Deformer::ApplyAll() {
  steps_since_full_ = 0;
  map_ = FitSimilarity(RestVertices(binding_->rig()), pose_.vertices,
                       binding_->dimension());
  std::vector<float> residuals(columns_.rows() * 3);
  for (int64_t c = 0; c < columns_.rows(); ++c) {
    const Vec3 residual = Residual(map_, posed_columns_, columns_, c);
    for (int d = 0; d < 3; ++d) {
      residuals[c * 3 + d] = static_cast<float>(residual(d));
    }
  }
  ForEachBlock([&](int64_t first, int64_t count) {
    std::vector<float> sums(count * kTileSums);
    ApplyTiles(binding_->weights().tile(first), count, columns_.rows(), 1,
               residuals.data(), sums.data());
    std::copy(sums.begin(), sums.end(),
              displacement_.data() + first * kTileSums);
  });
}

void Deformer::ApplyChanged(const std::vector<int32_t>& changed,
                            const Columns& next) {
  if (changed.empty()) return;
  ++steps_since_full_;
  std::vector<double> deltas;
  deltas.reserve(changed.size() * 3);
  for (const int32_t c : changed) {
    for (int d = 0; d < 3; ++d) deltas.push_back(next(c, d) - columns_(c, d));
  }
  ForEachBlock([&](int64_t first, int64_t count) {
    AddTileColumns(binding_->weights().tile(first), count, columns_.rows(),
                   changed.data(), static_cast<int64_t>(changed.size()),
                   deltas.data(), displacement_.data() + first * kTileSums);
  });
}

void Deformer::ForEachBlock(absl::FunctionRef<void(int64_t, int64_t)> body) {
  const int64_t tiles = binding_->weights().tiles();
  const auto block = [&](int64_t b) {
    const int64_t first = b * kTilesPerBlock;
    body(first, std::min(kTilesPerBlock, tiles - first));
  };
  const int64_t blocks = (tiles + kTilesPerBlock - 1) / kTilesPerBlock;
  const int64_t products = tiles * kTilePoints * columns_.rows();
  if (pool_ != nullptr && blocks > 1 && products > kParallelProducts) {
    pool_->ParallelFor(blocks, nullptr, block);
  } else {
    for (int64_t b = 0; b < blocks; ++b) block(b);
  }
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

}  // namespace deform
