// A model expressed by a rig: computed once, then used by every pose.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/base/cancellation.h"
#include "core/base/thread_pool.h"
#include "core/kernels/weight_tiles.h"
#include "core/mesh/mesh.h"
#include "core/mesh/rig.h"
#include "core/weights/exit_regions.h"
#include "core/weights/scheme.h"

namespace deform {

enum class Unbindable { kFail, kReport };

struct BindRequest {
  std::shared_ptr<const Mesh> model;
  Rig rig;
  std::string scheme;
  SchemeOptions options;
  ExitRegions exits;
  Unbindable unbindable = Unbindable::kFail;
};

// How a computation reports and is stopped. All may be null.
struct BindControl {
  ThreadPool* pool = nullptr;
  const Cancellation* cancellation = nullptr;
  // Points done so far; only rises. Read it from any thread.
  std::atomic<int64_t>* points_done = nullptr;
};

// Figures of how a binding came out.
struct BindQuality {
  // Largest |sum phi v + sum psi n - eta|, in units of D, of the weights as
  // they are cached: rounding to float alone makes about 1e-7 of it, times the
  // sum of |weight|. Positions count from the middle of the rig.
  double reproduction_error = 0;
  // Largest sum of |vertex weight| of a point.
  double weight_sum_max = 0;
  // Iterative schemes: largest and mean number of iterations.
  int iterations_max = 0;
  double iterations_mean = 0;
};

// Immutable; travels as shared_ptr<const Binding>.
class Binding {
 public:
  // Everything below, as Bind() fills it in.
  struct Parts {
    std::shared_ptr<const Mesh> model;
    Rig rig;
    const CoordinateScheme* scheme = nullptr;
    SchemeOptions options;
    // N x C, C = V (+ F if the scheme uses normals); rows of unbound points 0.
    WeightTiles weights;
    std::vector<ExitPart> exit_parts;
    std::vector<UnboundPoints> unbound;
    std::vector<std::string> warnings;
    BindQuality quality;
    double compute_seconds = 0;
  };
  explicit Binding(Parts parts);

  const std::shared_ptr<const Mesh>& model() const { return parts_.model; }
  const Rig& rig() const { return parts_.rig; }
  const CoordinateScheme& scheme() const { return *parts_.scheme; }
  const SchemeOptions& options() const { return parts_.options; }
  const WeightTiles& weights() const { return parts_.weights; }
  const std::vector<ExitPart>& exit_parts() const { return parts_.exit_parts; }
  const std::vector<UnboundPoints>& unbound() const { return parts_.unbound; }
  const std::vector<std::string>& warnings() const { return parts_.warnings; }
  const BindQuality& quality() const { return parts_.quality; }
  double compute_seconds() const { return parts_.compute_seconds; }

  int dimension() const { return parts_.model->dimension(); }
  int64_t point_count() const { return parts_.model->size(); }
  // Rows of a pose.
  int64_t vertex_count() const { return RestVertices(parts_.rig).rows(); }
  int64_t normal_count() const {
    return parts_.weights.columns() - vertex_count();
  }
  int64_t unbound_count() const { return unbound_count_; }
  // Points that stay at rest whatever the pose, sorted: those without weights.
  const std::vector<int64_t>& fixed_points() const { return fixed_points_; }

 private:
  Parts parts_;
  int64_t unbound_count_;
  std::vector<int64_t> fixed_points_;
};

// Computes the weights, tile by tile, on all threads of the pool. Errors:
//   NotFound UNKNOWN_SCHEME; InvalidArgument WRONG_RIG, INVALID_OPTION,
//   DIMENSION_MISMATCH, those of CheckExitRegions, CAGE_OVERLAPPING
//   FailedPrecondition EXTERIOR_NO_EXIT_FACE, EXIT_AMBIGUOUS, OUTSIDE_HULL,
//     NOT_CONVERGED, WEIGHT_TOO_LARGE (for float) with Unbindable::kFail: says
//     how many, names the first ten
//   Cancelled
absl::StatusOr<std::shared_ptr<const Binding>> Bind(const BindRequest& request,
                                                    const BindControl& control);

// The weights of points [first, first + count) again, in double: what Bind()
// cached, without the error of float. Rows of unbound points are 0.
// InvalidArgument RANGE_OUT_OF_BOUNDS if there are no such points.
absl::StatusOr<WeightBlock> RecomputeWeights(const Binding& binding,
                                             int64_t first, int64_t count);

}  // namespace deform
