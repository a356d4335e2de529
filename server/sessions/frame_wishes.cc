#include "server/sessions/frame_wishes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh.h"
#include "server/models/names.h"

namespace deform::server {
namespace {

constexpr double kLeastFps = 0.01;
constexpr double kMostFps = 1000;

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

absl::StatusOr<std::chrono::nanoseconds> IntervalOf(Delivery delivery,
                                                    double max_fps) {
  if (max_fps == 0) return std::chrono::nanoseconds(0);
  if (!(max_fps >= kLeastFps && max_fps <= kMostFps)) {
    return InvalidInput(
        "MAX_FPS_OUT_OF_RANGE", "max_fps",
        absl::StrCat("max_fps is ", max_fps, ", neither 0 nor within ",
                     kLeastFps, " and ", kMostFps));
  }
  if (delivery == Delivery::kEvery) {
    return InvalidInput("CONTRADICTION", "max_fps",
                        "max_fps leaves revisions out, but delivery EVERY "
                        "sends all: set one of them");
  }
  return std::chrono::nanoseconds(std::llround(1e9 / max_fps));
}

absl::Status CheckHasNormals(const Mesh& model) {
  if (model.dimension() == 3 && model.faces().rows() > 0) {
    return absl::OkStatus();
  }
  return MakeError(absl::StatusCode::kFailedPrecondition,
                   model.dimension() == 3
                       ? "the model has no faces, so its vertices have no "
                         "normals: join without"
                       : "a model in two dimensions has no normals: join "
                         "without",
                   {.reason = "NO_NORMALS", .field = "normals"});
}

// The best first.
std::vector<const FrameEncoding*> CandidatesOf(const FrameWishes& wishes) {
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
  return candidates;
}

absl::StatusOr<FrameFormat> PickFormat(
    std::span<const FrameEncoding* const> candidates,
    std::optional<double> tolerance, const Rig& rig) {
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
                   " for a rig of diagonal ", DiagonalOf(rig), ": ", best,
                   "; float32 is exact"));
}

}  // namespace

bool FrameWishes::TakesBasis() const {
  return std::any_of(
      encodings.begin(), encodings.end(),
      [](const auto* encoding) { return encoding->needs() == Needs::kBasis; });
}

absl::StatusOr<FrameFormats> PickFormats(const FrameWishes& wishes,
                                         const Rig& rig) {
  const double diagonal = DiagonalOf(rig);
  DEFORM_ASSIGN_OR_RETURN(const std::optional<double> tolerance,
                          ToleranceOf(wishes, diagonal));
  const auto candidates = CandidatesOf(wishes);
  DEFORM_ASSIGN_OR_RETURN(const FrameFormat format,
                          PickFormat(candidates, tolerance, rig));
  if (format.encoding->needs() == Needs::kNothing) {
    return FrameFormats{format, format};
  }
  std::vector<const FrameEncoding*> others;
  for (const FrameEncoding* const encoding : candidates) {
    if (encoding->needs() == Needs::kNothing) others.push_back(encoding);
  }
  // Everybody takes it.
  if (others.empty()) others.push_back(FindEncoding("float32"));
  DEFORM_ASSIGN_OR_RETURN(const FrameFormat otherwise,
                          PickFormat(others, tolerance, rig));
  return FrameFormats{format, otherwise};
}

absl::StatusOr<Subscription> Subscribe(Delivery delivery,
                                       const FrameWishes& wishes,
                                       const Rig& rig, const Mesh& model) {
  DEFORM_ASSIGN_OR_RETURN(const FrameFormats formats, PickFormats(wishes, rig));
  if (wishes.normals) DEFORM_RETURN_IF_ERROR(CheckHasNormals(model));
  DEFORM_ASSIGN_OR_RETURN(const auto interval,
                          IntervalOf(delivery, wishes.max_fps));
  return Subscription{.delivery = delivery,
                      .format = formats.format,
                      .otherwise = formats.otherwise,
                      .weights = wishes.weights,
                      .normals = wishes.normals,
                      .interval = interval};
}

}  // namespace deform::server
