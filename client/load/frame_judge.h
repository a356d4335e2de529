// Whether a frame is what its pose makes of the model.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/client.h"
#include "core/deform/columns.h"
#include "core/mesh/rig.h"

namespace deform {

// Deforms in double precision, with weights in double precision, and compares.
// Of a model with more than kMaxWeights weights, runs of points all over it are
// compared instead of all. Immutable.
class FrameJudge {
 public:
  static constexpr int64_t kMaxWeights = int64_t{1} << 22;

  // Computes the weights here: nothing of the server's is believed.
  static absl::StatusOr<FrameJudge> FromModel(const ModelArrays& model,
                                              const BindingSpec& spec,
                                              double tolerance);
  // Asks the server for them. Points that stay at rest are not compared.
  static absl::StatusOr<FrameJudge> FromServer(Client& client,
                                               const BindingInfo& binding,
                                               const Rig& rig,
                                               double tolerance);

  int64_t points() const { return static_cast<int64_t>(points_.size()); }

  struct Verdict {
    // The farthest from its place, and by how much, as a fraction of the
    // diagonal of the rig, at rest or posed, whichever is larger.
    int64_t vertex = -1;
    double error = 0;
    bool ok = true;  // Within the tolerance; NaN is not.
  };
  Verdict Judge(const Frame& frame, const Pose& pose) const;

 private:
  using Matrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  FrameJudge(const Rig& rig, bool uses_normals, double tolerance)
      : rest_diagonal_(DiagonalOf(rig)),
        tolerance_(tolerance),
        columns_(rig, uses_normals) {}

  double rest_diagonal_;
  double tolerance_;  // As Verdict::error.
  PosedColumns columns_;
  std::vector<int64_t> points_;
  Matrix weights_;  // A row for each of points_, a column as of columns_.
};

}  // namespace deform
