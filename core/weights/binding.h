// A model expressed by a rig: computed once, then used by every pose.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/base/cancellation.h"
#include "core/base/thread_pool.h"
#include "core/kernels/weight_tiles.h"
#include "core/mesh/mesh.h"
#include "core/mesh/rig.h"
#include "core/weights/bind_quality.h"
#include "core/weights/compressed_weights.h"
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
  // 0: dense weights. Else they are compressed to this (compress_binding.h),
  // cluster by cluster, so that the dense ones never exist at once; they are
  // computed twice.
  double weight_tolerance = 0;
  // Points that stay at rest whatever the pose; sorted, each once. They need no
  // weights, so it does not matter where they are.
  std::vector<int64_t> clamped;
};

// How a computation reports and is stopped. All may be null.
struct BindControl {
  ThreadPool* pool = nullptr;
  const Cancellation* cancellation = nullptr;
  // Points done so far; only rises. Read it from any thread.
  std::atomic<int64_t>* points_done = nullptr;
  // Solutions of another binding of the model by the same scheme: where the
  // searches start.
  const Solutions* known = nullptr;
  // Compressed weights that take more are given up; 0: no limit.
  int64_t max_weight_bytes = 0;
};

// What is known of a binding beside its weights: small, and enough to compute
// them again. Immutable; copies share one state.
class BindingFacts {
 public:
  // Everything below, as Bind() fills it in.
  struct Parts {
    BindRequest request;
    const CoordinateScheme* scheme = nullptr;
    int64_t columns = 0;  // C = V (+ F if the scheme uses normals).
    std::vector<ExitPart> exit_parts;
    std::vector<UnboundPoints> unbound;
    std::vector<std::string> warnings;
    BindQuality quality;
    double compute_seconds = 0;
  };
  explicit BindingFacts(Parts parts);

  // Bind() computes the same weights from it again.
  const BindRequest& request() const { return state_->request; }
  const std::shared_ptr<const Mesh>& model() const { return request().model; }
  const Rig& rig() const { return request().rig; }
  const CoordinateScheme& scheme() const { return *state_->scheme; }
  const SchemeOptions& options() const { return request().options; }
  const std::vector<ExitPart>& exit_parts() const { return state_->exit_parts; }
  const std::vector<UnboundPoints>& unbound() const { return state_->unbound; }
  const std::vector<int64_t>& clamped() const { return request().clamped; }
  const std::vector<std::string>& warnings() const { return state_->warnings; }
  const BindQuality& quality() const { return state_->quality; }
  double compute_seconds() const { return state_->compute_seconds; }

  int dimension() const { return model()->dimension(); }
  int64_t point_count() const { return model()->size(); }
  // Columns of the weights that belong to vertices or handles: those of a pose
  // (PoseRows), then the fixed handles.
  int64_t vertex_count() const { return RestVertices(rig()).rows(); }
  int64_t column_count() const { return state_->columns; }
  int64_t normal_count() const { return column_count() - vertex_count(); }
  int64_t unbound_count() const {
    return static_cast<int64_t>(fixed_points().size() - clamped().size());
  }
  // Points that stay at rest whatever the pose, sorted: the unbound and the
  // clamped.
  const std::vector<int64_t>& fixed_points() const {
    return state_->fixed_points;
  }

  // Memory of the above, without the model.
  int64_t bytes() const;

 private:
  struct State : Parts {
    std::vector<int64_t> fixed_points;
  };
  std::shared_ptr<const State> state_;
};

// Facts and weights. Immutable; travels as shared_ptr<const Binding>.
class Binding : public BindingFacts {
 public:
  // N x C; rows of fixed points are 0. `solutions` are those of iterative
  // schemes.
  Binding(BindingFacts facts, std::shared_ptr<const WeightTiles> weights,
          std::shared_ptr<const Solutions> solutions = nullptr)
      : BindingFacts(std::move(facts)),
        weights_(std::move(weights)),
        solutions_(std::move(solutions)) {}
  Binding(BindingFacts facts, std::shared_ptr<const CompressedWeights> weights,
          std::shared_ptr<const Solutions> solutions = nullptr)
      : BindingFacts(std::move(facts)),
        compressed_(std::move(weights)),
        solutions_(std::move(solutions)) {}

  // Only if they are dense.
  const WeightTiles& weights() const { return *weights_; }
  // Null if they are dense.
  const CompressedWeights* compressed() const { return compressed_.get(); }

  // What is held beside the facts.
  int64_t weight_bytes() const {
    return (compressed_ ? compressed_->bytes() : weights_->bytes()) +
           (solutions_ ? solutions_->size() * int64_t{4} : 0);
  }
  // Weights of points [first, first + count) by rows, count x C, in either
  // form.
  void CopyWeights(int64_t first, int64_t count, float* out) const;
  // The same weights for other facts, such as those of an equal binding.
  std::shared_ptr<const Binding> WithFacts(BindingFacts facts) const;
  // N x 3, of iterative schemes; else null.
  const std::shared_ptr<const Solutions>& solutions() const {
    return solutions_;
  }

 private:
  // One of these.
  std::shared_ptr<const WeightTiles> weights_;
  std::shared_ptr<const CompressedWeights> compressed_;

  std::shared_ptr<const Solutions> solutions_;
};

// Computes the weights, tile by tile, on all threads of the pool. Errors:
//   NotFound UNKNOWN_SCHEME; InvalidArgument WRONG_RIG, INVALID_OPTION,
//   DIMENSION_MISMATCH, WEIGHT_TOLERANCE_OUT_OF_RANGE,
//   INDEX_OUT_OF_RANGE (clamped), those of
//   CheckExitRegions, CAGE_OVERLAPPING
//   FailedPrecondition EXTERIOR_NO_EXIT_FACE, EXIT_AMBIGUOUS, OUTSIDE_HULL,
//     NOT_CONVERGED, WEIGHT_TOO_LARGE (for float) with Unbindable::kFail: says
//     how many, names the first ten
//   ResourceExhausted NOT_SMALLER; Cancelled
absl::StatusOr<std::shared_ptr<const Binding>> Bind(const BindRequest& request,
                                                    const BindControl& control);

// The weights of points [first, first + count) again, in double: what Bind()
// cached, without the error of float. Rows of fixed points are 0.
// InvalidArgument RANGE_OUT_OF_BOUNDS if there are no such points.
absl::StatusOr<WeightBlock> RecomputeWeights(const BindingFacts& binding,
                                             int64_t first, int64_t count);

}  // namespace deform
