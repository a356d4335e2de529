// Pose in, positions out, for one session.
//
//   x = T eta + sum phi (v' - T v) + sum psi (s n' - A n)
//
// with T = (A, t) the similarity that fits the pose best, applied in double. So
// the rest pose and rigid motion are exact, and the errors of float and of
// compressed weights scale with the deformation that is left. Source: [L08] Eq.
// 9 in displacement form, exact because the weights reproduce eta and their
// vertex part sums to 1.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/allowance.h"
#include "core/base/thread_pool.h"
#include "core/deform/affine_map.h"
#include "core/deform/columns.h"
#include "core/deform/pose.h"
#include "core/deform/weighted_sums.h"
#include "core/weights/binding.h"

namespace deform {

struct DeformReport {
  // Weight columns applied: all of them, or those of the moved vertices and of
  // the faces incident to them ([L08] section 5).
  int64_t columns_applied = 0;
  bool full = false;
  // How far crossed faces deviate from the similarity of their exit face; see
  // ExitMismatch().
  double exit_mismatch = 0;
  // How far compression may have moved any point, in model units: the bound of
  // the weights times the largest displacement of a column from the best
  // similarity, in its R_c (compress_binding.h). 0 with dense weights.
  double error_bound = 0;
};

struct DeformJob;

// Not thread-safe: one session, one Deformer. Only const calls may run at once.
class Deformer {
 public:
  // kAutomatic applies only the columns that changed since the last call where
  // that is cheaper. Their sums are kept in double, and a full pass is made now
  // and then, so both paths agree to 1e-6 D however many steps were taken.
  enum class Path { kAutomatic, kFull };

  // Starts at the rest pose. `pool` may be null. Fast drags take memory of
  // `copies` (MovedColumns). Both are borrowed.
  Deformer(std::shared_ptr<const Binding> binding, ThreadPool* pool,
           Allowance& copies = Unlimited());

  // Moves to `pose`, which is right (CheckPoseUpdate).
  DeformReport MoveTo(const Pose& pose, Path path = Path::kAutomatic);

  const Binding& binding() const { return *binding_; }
  const Pose& pose() const { return pose_; }

  // All deformed points, N x 3.
  Positions positions() const;

  // The same without the points, for who holds the leaves of compressed weights
  // (core/frames/leaf_basis.h): T, and the coefficients of all leaves, 3 floats
  // for each of CompressedWeights::coefficient_rows(). Empty with dense ones.
  const AffineMap& map() const { return map_; }
  std::vector<float> LeafCoefficients() const {
    return sums_->LeafCoefficients(pool_);
  }

  // Deformed points [first, first + count) relative to `origin`, rounded once:
  // count x dimension floats.
  void CopyRelative(int64_t first, int64_t count, const Vec3& origin,
                    float* out) const;

 private:
  friend void MoveTogether(std::span<DeformJob> jobs, ThreadPool* pool);

  // What a step does to the sums: adds values x the columns that moved, or, if
  // full, makes them anew from the residuals of all columns.
  struct Change {
    bool full = false;
    std::vector<int32_t> columns;  // That moved.
    std::vector<double> values;    // 3 for each of them; of all, if full.
  };

  // Everything of a step but the sums.
  Change Begin(const Pose& pose, Path path);
  DeformReport Report(const Change& change) const;
  // The rows of `pose` that differ from the current one; all if the stretch
  // blend does.
  std::vector<int32_t> MovedVertices(const Pose& pose) const;
  bool PrefersFull(const std::vector<int32_t>& changed,
                   const Columns& next) const;
  Vec3 Residual(const Columns& columns, int64_t c) const;
  // Of all columns of the pose, in units of R_c.
  double LargestResidual() const;
  // It stays at rest.
  bool is_fixed(int64_t point) const {
    return !fixed_.empty() && fixed_[point];
  }

  const std::shared_ptr<const Binding> binding_;
  ThreadPool* const pool_;
  const PosedColumns posed_columns_;
  std::vector<char> fixed_;          // N, or empty if no point stays at rest.
  std::vector<double> pose_bounds_;  // R_c; empty with dense weights.

  Pose pose_;
  Columns columns_;  // Of pose_.
  AffineMap map_;    // T, as of the last full pass.
  int steps_since_full_ = 0;
  const std::unique_ptr<WeightedSums> sums_;  // Of the residuals.
};

// One step of one of several sessions.
struct DeformJob {
  Deformer* deformer = nullptr;
  const Pose* pose = nullptr;  // Right (CheckPoseUpdate).
  Deformer::Path path = Deformer::Path::kAutomatic;
  DeformReport report;  // Filled in.
};

// Deformer::MoveTo() for different deformers of the same Binding in one walk
// over its weights, which costs a session a fraction of a walk of its own. The
// results are those of MoveTo(), to the rounding of float sums. All is
// borrowed; `pool` may be null.
void MoveTogether(std::span<DeformJob> jobs, ThreadPool* pool);

}  // namespace deform
