// The seam for coordinate schemes: how a point is expressed by a rig.
//
// With p the V rig vertices and n the F unit outward face normals at rest,
//
//   x = sum_k vertex(k) p_k + sum_j normal(j) n_j
//
// To add a scheme: write schemes/<name>.cc, then add one line to
// builtin_schemes.cc. The property tests run over that list.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/mesh/rig.h"
#include "core/mesh/types.h"

namespace deform {

enum class RigKind { kCage, kHandles };

// What became of a point.
enum class PointState : uint8_t {
  kInside,
  kBoundary,
  // Outside, and this scheme reaches it only through an exit face; its vertex
  // weights sum to 0 and are of no use until WeightEvaluator::Extend.
  kOutside,
  // Bound although outside: the scheme (mean value) needs no exit face.
  kBoundOutside,
  // Handles: no positive weights exist.
  kOutsideHull,
  // The solver did not converge; never a silent weight.
  kNotConverged,
  // Cage: it winds neither 0 nor 1 times around this point: parts of it overlap
  // or are inverted.
  kOverlap,
};

using RowMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Where the searches of an iterative scheme ended, a row for each point; 0
// where there is no solution. Those of nearly the same rig may start there.
using Solutions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Weights of a block of points, in double.
struct WeightBlock {
  // The caller's: solutions for a similar rig, n x 3, or none. The weights
  // depend on them by rounding only.
  Solutions known;
  RowMatrix vertex;  // n x V, no unit; every bound row sums to 1.
  RowMatrix normal;  // n x F, model units; n x 0 if normals are not used.
  std::vector<PointState> states;  // n
  // n for iterative schemes, else empty. The residual is how far a point is
  // from solving its equations, without unit: |sum beta q| / sum beta of
  // celestial coordinates. 0 for points that needed no search.
  std::vector<uint16_t> iterations;
  std::vector<double> residuals;
  Solutions solutions;
};

// Weights of a block of points as they are cached: float, in tiles.
struct TileBlock {
  // The caller's: columns x 16 for each tile, as WeightTiles has it, with V or
  // V + F columns. Every weight is written; padding with 0, and what float
  // cannot hold with infinity.
  float* tiles = nullptr;
  // As in WeightBlock.
  Solutions known;
  std::vector<PointState> states;
  std::vector<uint16_t> iterations;
  std::vector<double> residuals;
  Solutions solutions;
};

// To be added to a weight. Columns count the vertices, then the normals.
struct WeightShare {
  int64_t column = 0;
  double weight = 0;
};

// A scheme prepared for one rig. Has no state that changes: one object serves
// every thread.
class WeightEvaluator {
 public:
  virtual ~WeightEvaluator() = default;

  // Computes the weights of `points` (n x 3, model units), which should be
  // neighbours, into `block`, resized as needed. Points on a cage get the limit
  // from inside. Rows of points that are not bound are 0, but for those of
  // outside points. O(n (V + F)).
  virtual void Evaluate(const PositionsRef& points,
                        WeightBlock& block) const = 0;

  // The same to the precision of float, at the speed that allows: within 1e-6,
  // normals times the size of the rig, beyond what the doubles lose.
  virtual void EvaluateTiles(const PositionsRef& points,
                             TileBlock& block) const;

  // What is to be added to the row of an outside point so that it follows
  // `exit_face`. Only for schemes that report kOutside.
  virtual std::array<WeightShare, 4> Extend(const Vec3& /*point*/,
                                            int64_t /*exit_face*/) const {
    return {};
  }

  // Sets the gradients of the weights with respect to the point: `vertex` is
  // V x 3, `normal` F x 3. `exit_face` is the one the point is extended
  // through, or -1. The point does not lie on the rig. Returns false, with
  // nothing set, if the scheme has no closed form: differences are to be taken.
  virtual bool Differentiate(const Vec3& /*point*/, int64_t /*exit_face*/,
                             Eigen::Ref<Positions> /*vertex*/,
                             Eigen::Ref<Positions> /*normal*/) const {
    return false;
  }
};

struct SchemeOptions {
  // T-CC: s_i >= 0, one per free handle; empty means all 0. Those of fixed
  // handles are 0.
  std::vector<double> handle_weights;
  // S-CC: > 1; 0 means 2. Accepted for those who have a value: it cancels out.
  double lambda = 0;
};

// One way to express a point by a rig. Implementations have no state.
class CoordinateScheme {
 public:
  virtual ~CoordinateScheme() = default;

  // Name on the wire and in stored bindings; it never changes meaning.
  virtual absl::string_view id() const = 0;
  // One line for people.
  virtual absl::string_view description() const = 0;
  virtual RigKind rig_kind() const = 0;
  // Whether face normals have weights. A rest pose's normals are n, a posed
  // face's s n' with the stretch s of [L08] Eq. 13 and 14.
  virtual bool uses_normals() const = 0;

  // Prepares what depends on the rig alone. The evaluator keeps a copy of what
  // it needs. Returns InvalidArgument (WRONG_RIG, INVALID_OPTION) if the rig is
  // of the other kind or the options are out of range.
  virtual absl::StatusOr<std::unique_ptr<const WeightEvaluator>> Prepare(
      const Rig& rig, const SchemeOptions& options) const = 0;
};

// All schemes, in the order of builtin_schemes.cc.
std::span<const CoordinateScheme* const> AllSchemes();

// NotFound (UNKNOWN_SCHEME) that lists the known ones.
absl::StatusOr<const CoordinateScheme*> FindScheme(absl::string_view id);

}  // namespace deform
