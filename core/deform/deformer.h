// Pose in, positions out, for one session.
//
//   x = T eta + sum phi (v' - T v) + sum psi (s n' - A n)
//
// with T = (A, t) the similarity that fits the pose best (handles: the affine
// map), applied in double. So the rest pose and rigid motion are exact, and
// float errors scale with the deformation that is left. Source: [L08] Eq. 9 in
// displacement form, which is exact because the weights reproduce eta.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/thread_pool.h"
#include "core/deform/columns.h"
#include "core/deform/pose.h"
#include "core/weights/binding.h"

namespace deform {

struct DeformReport {
  // Weight columns applied: all of them, or those of the moved vertices and of
  // the faces incident to them ([L08] section 5).
  int64_t columns_applied = 0;
  bool full = false;
  // How far crossed faces deviate from the similarity of their exit face; see
  // ExitMismatch() in columns.h.
  double exit_mismatch = 0;
};

// Not thread-safe: one session, one Deformer.
class Deformer {
 public:
  enum class Path { kAutomatic, kFull };

  // Starts at the rest pose. `pool` may be null; borrowed.
  Deformer(std::shared_ptr<const Binding> binding, ThreadPool* pool);

  // Moves to `pose`, which is right (CheckPoseUpdate). With kAutomatic only the
  // columns that changed since the last call are applied where that is cheaper;
  // a full pass is made before float drift can exceed 2.5e-7 D.
  DeformReport MoveTo(const Pose& pose, Path path = Path::kAutomatic);

  const Binding& binding() const { return *binding_; }
  const Pose& pose() const { return pose_; }

  // All deformed points, N x 3.
  Positions positions() const;

  // Deformed points [first, first + count) relative to `origin`, rounded once:
  // count x dimension floats.
  void CopyRelative(int64_t first, int64_t count, const Vec3& origin,
                    float* out) const;

 private:
  void FitFrame();
  void ApplyAll();
  void ApplyChanged(const std::vector<int32_t>& changed);
  Vec3 PointAt(int64_t point) const;
  void ForTiles(absl::FunctionRef<void(int64_t)> body);

  const std::shared_ptr<const Binding> binding_;
  ThreadPool* const pool_;
  const PosedColumns posed_columns_;
  std::vector<char> fixed_;  // N; empty if no point is fixed.

  Pose pose_;
  AffineMap frame_;      // T, as of the last full pass.
  RowMatrix columns_;    // C x 3, posed columns, model units.
  std::vector<float> displacement_;  // tiles x 3 x 16
  double drift_ = 0;     // Bound on the float error gathered, model units.
};

}  // namespace deform
