#include "server/sessions/frame_wishes.h"

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"
#include "server/models/names.h"

namespace deform::server {
namespace {

// In model units; none if none is stated.
absl::StatusOr<std::optional<double>> ToleranceOf(const FrameWishes& wishes,
                                                  double diagonal) {
  if (wishes.tolerance && wishes.tolerance_fraction) {
    return InvalidInput("CONTRADICTION", "tolerance_fraction",
                        "tolerance and tolerance_fraction are both set: state "
                        "one of them");
  }
  if (!wishes.tolerance && !wishes.tolerance_fraction) return std::nullopt;
  const double tolerance = wishes.tolerance
                               ? *wishes.tolerance
                               : *wishes.tolerance_fraction * diagonal;
  DEFORM_RETURN_IF_ERROR(CheckTolerance(tolerance));
  return tolerance;
}

}  // namespace

absl::StatusOr<FrameFormat> PickFormat(const FrameWishes& wishes,
                                       const Rig& rig) {
  const double diagonal = DiagonalOf(rig);
  DEFORM_ASSIGN_OR_RETURN(const std::optional<double> tolerance,
                          ToleranceOf(wishes, diagonal));
  std::vector<const FrameEncoding*> candidates = wishes.encodings;
  if (candidates.empty()) candidates.push_back(FindEncoding("float32"));
  if (wishes.cheapest) {
    const auto all = AllEncodings();  // The cheapest last.
    std::sort(candidates.begin(), candidates.end(),
              [&](const FrameEncoding* a, const FrameEncoding* b) {
                return std::find(all.begin(), all.end(), a) >
                       std::find(all.begin(), all.end(), b);
              });
  }
  const Box box = BoxOf(RestVertices(rig));
  const double reach = 0.5 * (box.max - box.min).maxCoeff();
  std::string best;
  for (const FrameEncoding* const encoding : candidates) {
    if (encoding->is_exact()) return FrameFormat{.encoding = encoding};
    if (!tolerance) {
      return InvalidInput(
          "TOLERANCE_MISSING", "tolerance",
          absl::StrCat("encoding ", Quoted(encoding->id()),
                       " needs a tolerance: set tolerance (model units) or "
                       "tolerance_fraction (of the rig's diagonal)"));
    }
    const double finest = encoding->FinestTolerance(reach);
    if (finest <= *tolerance) {
      return FrameFormat{.encoding = encoding, .tolerance = *tolerance};
    }
    absl::StrAppend(&best, best.empty() ? "" : ", ", encoding->id(), " keeps ",
                    finest);
  }
  return InvalidInput(
      "TOLERANCE_NOT_MET", "encodings",
      absl::StrCat("none of the encodings keeps a tolerance of ", *tolerance,
                   " for a rig of diagonal ", diagonal, ": ", best,
                   "; float32 is exact"));
}

}  // namespace deform::server
