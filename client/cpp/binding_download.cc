#include "client/cpp/binding_download.h"

#include <algorithm>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

bool AllWithin(std::span<const int64_t> numbers, int64_t limit) {
  return std::all_of(numbers.begin(), numbers.end(),
                     [&](int64_t n) { return n >= 0 && n < limit; });
}

// So that deforming reads no more than there is.
absl::Status CheckFits(const BindingInfo& info, const Mesh& mesh,
                       const Rig& rig) {
  DEFORM_ASSIGN_OR_RETURN(const CoordinateScheme* const scheme,
                          FindScheme(info.scheme));
  const Cage* const cage = std::get_if<Cage>(&rig);
  const int64_t faces = cage != nullptr ? cage->face_count() : 0;
  bool fits = info.normal_count == (scheme->uses_normals() ? faces : 0) &&
              (cage != nullptr) == (scheme->rig_kind() == RigKind::kCage) &&
              DimensionOf(rig) == mesh.dimension() &&
              AllWithin(info.clamped, mesh.size());
  for (const UnboundInfo& unbound : info.unbound) {
    fits = fits && AllWithin(unbound.points, mesh.size());
  }
  for (const ExitPartInfo& part : info.exit_parts) {
    fits = fits && AllWithin({&part.exit_face, 1}, faces) &&
           AllWithin(part.crossed_faces, faces);
  }
  if (fits) return absl::OkStatus();
  return InvalidInput("BAD_ANSWER", "binding",
                      "the server sent a model or a rig that does not fit its "
                      "binding");
}

}  // namespace

absl::StatusOr<BindingFacts> FactsOf(const BindingInfo& info, Mesh mesh,
                                     Rig rig) {
  DEFORM_RETURN_IF_ERROR(CheckFits(info, mesh, rig));
  BindingFacts::Parts parts{
      .request = {.model = std::make_shared<const Mesh>(std::move(mesh)),
                  .rig = std::move(rig),
                  .scheme = info.scheme,
                  .weight_tolerance = info.weight_tolerance,
                  .clamped = info.clamped}};
  DEFORM_ASSIGN_OR_RETURN(parts.scheme, FindScheme(info.scheme));
  parts.columns = RestVertices(parts.request.rig).rows() + info.normal_count;
  for (const ExitPartInfo& part : info.exit_parts) {
    parts.exit_parts.push_back(
        {.exit_face = static_cast<int32_t>(part.exit_face),
         .crossed_faces = {part.crossed_faces.begin(),
                           part.crossed_faces.end()}});
  }
  for (const UnboundInfo& unbound : info.unbound) {
    parts.unbound.push_back(
        {.reason = unbound.reason, .points = unbound.points});
  }
  parts.warnings = info.warnings;
  parts.quality = info.quality;
  return BindingFacts(std::move(parts));
}

absl::Status WeightsDownload::Add(const WeightRows& rows) {
  const int64_t count = rows.vertex.rows();
  const int64_t columns = rows.vertex.cols() + rows.normal.cols();
  if (rows.first_point != received_ || count > total() - received_ ||
      columns != weights_.columns()) {
    return InvalidInput(
        "BAD_ANSWER", "weights",
        absl::StrCat("the server sent ", count, " rows of ", columns,
                     " weights from point ", rows.first_point, " on, where ",
                     received_, " of ", total(), " rows of ",
                     weights_.columns(), " were reached"));
  }
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t c = 0; c < rows.vertex.cols(); ++c) {
      weights_.set(received_, c, static_cast<float>(rows.vertex(i, c)));
    }
    for (int64_t c = 0; c < rows.normal.cols(); ++c) {
      weights_.set(received_, rows.vertex.cols() + c,
                   static_cast<float>(rows.normal(i, c)));
    }
    ++received_;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const WeightTiles>>
WeightsDownload::Finish() && {
  if (received_ == total()) {
    return std::make_shared<const WeightTiles>(std::move(weights_));
  }
  return InvalidInput("BAD_ANSWER", "weights",
                      absl::StrCat("the server sent the weights of ", received_,
                                   " of ", total(), " points"));
}

}  // namespace deform
