// The compressed form of a binding.
#pragma once

#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/weights/binding.h"

namespace deform {

// The smallest tolerance that is of use: float sums lose about as much.
inline constexpr double kFinestTolerance = 1e-6;
inline constexpr double kCoarsestTolerance = 1e-2;

// R_c of the columns, as compress_weights.h counts displacements: 1 for
// vertices, 2 / D for normals. A pose scales a normal to a length of about 1,
// and so moves it by up to about 2; vertices move by about D. So errors are in
// model units, and a fraction of D where no column moves by more than that.
std::vector<double> PoseBounds(const BindingFacts& facts);

// A binding with weights compressed to `tolerance`, from kFinestTolerance on:
// a fraction of D for poses that move vertices by up to D and scaled normals by
// up to 2, after the best similarity is taken out. See CompressWeights(). From
// the dense weights of `facts`, or, if null, computed again cluster by cluster.
// `solutions` go along as they are. The bound may come out larger than the
// tolerance where float sums cannot keep it. Cancelled, NOT_SMALLER (see
// BindControl::max_weight_bytes).
absl::StatusOr<std::shared_ptr<const Binding>> CompressBinding(
    const BindingFacts& facts, const WeightTiles* dense, double tolerance,
    const BindControl& control,
    std::shared_ptr<const Solutions> solutions = nullptr);

// InvalidArgument WEIGHT_TOLERANCE_OUT_OF_RANGE; 0 is dense.
absl::Status CheckWeightTolerance(double tolerance);

// Dense weights that lie in the processor's caches anyway gain nothing.
bool WorthCompressing(int64_t dense_bytes);

}  // namespace deform
