#include "core/mesh/handles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/QR>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"

namespace deform {
namespace {

constexpr char kField[] = "rig.handles.positions";

// How many dimensions `positions` span (0 to `dimension`).
//
// The columns of a pivoted QR factorisation of the offsets from the first
// handle measure how far the handles reach into one more direction. Set aside
// are directions thinner than the rounding of the coordinates, which is all
// that lifts handles of one rotated plane off it, and than 1e-9 D: the solver's
// equations have the condition (D / thickness)^2, beyond all digits there.
int SpannedDimensions(int dimension, const Positions& positions,
                      double diagonal) {
  if (!(diagonal > 0)) return 0;
  const Eigen::MatrixXd offsets =
      (positions.rowwise() - positions.row(0)).leftCols(dimension) / diagonal;
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(offsets);
  const double rounding = 8 * std::numeric_limits<double>::epsilon() *
                          positions.cwiseAbs().maxCoeff() / diagonal;
  const double per_handle = std::max(rounding, 1e-9);
  const double threshold =
      per_handle * std::sqrt(static_cast<double>(positions.rows()));
  int spanned = 0;
  while (spanned < dimension &&
         std::abs(qr.matrixQR()(spanned, spanned)) > threshold) {
    ++spanned;
  }
  return spanned;
}

absl::Status CheckSpan(int dimension, const Positions& positions,
                       double diagonal) {
  const int spanned = SpannedDimensions(dimension, positions, diagonal);
  if (spanned == dimension) return absl::OkStatus();
  constexpr const char* kPlace[] = {"at one point", "on one line",
                                    "in one plane"};
  return InvalidInput(
      "DEGENERATE_HANDLES", kField,
      absl::StrCat("all ", positions.rows(), " handles lie ", kPlace[spanned],
                   ": they must span ", dimension, " dimensions"));
}

}  // namespace

absl::StatusOr<Handles> Handles::Create(int dimension, Positions positions) {
  if (dimension != 2 && dimension != 3) {
    return InvalidInput(
        "BAD_DIMENSION", "rig.handles.dimension",
        absl::StrCat("dimension must be 2 or 3, not ", dimension));
  }
  DEFORM_RETURN_IF_ERROR(CheckPositions(positions, "handle", kField));
  if (positions.rows() < dimension + 1) {
    return InvalidInput(
        "DEGENERATE_HANDLES", kField,
        absl::StrCat("a ", dimension, "D rig needs at least ", dimension + 1,
                     " handles, not ", positions.rows()));
  }
  for (int64_t i = 0; dimension == 2 && i < positions.rows(); ++i) {
    if (positions(i, 2) != 0) {
      return InvalidInput("NOT_PLANAR", kField,
                          absl::StrCat("handle ", i, " of a 2D rig has z = ",
                                       positions(i, 2), ", not 0"));
    }
  }
  const double diagonal = BoxOf(positions).diagonal();
  DEFORM_RETURN_IF_ERROR(CheckSpan(dimension, positions, diagonal));
  return Handles(dimension, std::move(positions), diagonal);
}

Handles::Handles(int dimension, Positions positions, double diagonal)
    : dimension_(dimension),
      positions_(std::move(positions)),
      diagonal_(diagonal) {}

}  // namespace deform
