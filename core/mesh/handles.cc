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
constexpr char kFixedField[] = "rig.handles.fixed_positions";

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

absl::Status CheckPlanar(const Positions& positions, absl::string_view what,
                         absl::string_view field) {
  for (int64_t i = 0; i < positions.rows(); ++i) {
    if (positions(i, 2) == 0) continue;
    return InvalidInput("NOT_PLANAR", field,
                        absl::StrCat(what, " ", i, " of a 2D rig has z = ",
                                     positions(i, 2), ", not 0"));
  }
  return absl::OkStatus();
}

absl::Status CheckCount(int dimension, int64_t free, int64_t fixed) {
  if (free == 0 && fixed > 0) {
    return InvalidInput("DEGENERATE_HANDLES", kField,
                        "all handles are fixed: at least one must be free to "
                        "be posed");
  }
  if (free + fixed > dimension) return absl::OkStatus();
  return InvalidInput(
      "DEGENERATE_HANDLES", kField,
      absl::StrCat("a ", dimension, "D rig needs at least ", dimension + 1,
                   " handles, not ", free + fixed));
}

}  // namespace

absl::StatusOr<Handles> Handles::Create(int dimension, Positions free,
                                        const Positions& fixed) {
  if (dimension != 2 && dimension != 3) {
    return InvalidInput(
        "BAD_DIMENSION", "rig.handles.dimension",
        absl::StrCat("dimension must be 2 or 3, not ", dimension));
  }
  DEFORM_RETURN_IF_ERROR(CheckPositions(free, "handle", kField));
  DEFORM_RETURN_IF_ERROR(CheckPositions(fixed, "fixed handle", kFixedField));
  DEFORM_RETURN_IF_ERROR(CheckCount(dimension, free.rows(), fixed.rows()));
  if (dimension == 2) {
    DEFORM_RETURN_IF_ERROR(CheckPlanar(free, "handle", kField));
    DEFORM_RETURN_IF_ERROR(CheckPlanar(fixed, "fixed handle", kFixedField));
  }
  const int64_t free_count = free.rows();
  Positions positions = std::move(free);
  if (fixed.rows() > 0) {
    positions.conservativeResize(free_count + fixed.rows(), 3);
    positions.bottomRows(fixed.rows()) = fixed;
  }
  const double diagonal = BoxOf(positions).diagonal();
  DEFORM_RETURN_IF_ERROR(CheckSpan(dimension, positions, diagonal));
  return Handles(dimension, std::move(positions), free_count, diagonal);
}

Handles::Handles(int dimension, Positions positions, int64_t free_count,
                 double diagonal)
    : dimension_(dimension),
      positions_(std::move(positions)),
      free_count_(free_count),
      diagonal_(diagonal) {}

Positions BoxHandles(const Mesh& model) {
  constexpr double kEnlargement = 1.6;
  constexpr double kLeastSide = 0.01;
  const Box& box = model.box();
  const Vec3 size = box.max - box.min;
  // Far from the origin a side must show in the digits that are left; a model
  // of one point there has nothing but 1 to measure by.
  const double far = 1e-9 * std::max(box.max.cwiseAbs().maxCoeff(),
                                     box.min.cwiseAbs().maxCoeff());
  double least = std::max(kLeastSide * box.diagonal(), far);
  if (!(least > 0)) least = 1;
  const int dimension = model.dimension();
  Positions corners = Positions::Zero(int64_t{1} << dimension, 3);
  for (int64_t i = 0; i < corners.rows(); ++i) {
    for (int d = 0; d < dimension; ++d) {
      const double half = 0.5 * kEnlargement * std::max(size[d], least);
      corners(i, d) = box.center()[d] + ((i >> d & 1) != 0 ? half : -half);
    }
  }
  return corners;
}

}  // namespace deform
