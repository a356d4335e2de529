// What a client downloads: weights, models, and both together.
#include <algorithm>
#include <span>
#include <utility>

#include "client/cpp/client_impl.h"
#include "client/cpp/convert.h"
#include "client/cpp/model_download.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/binding.h"

namespace deform {
namespace {

// What GetBinding tells of a binding, as far as deforming needs it.
absl::StatusOr<BindingFacts> FactsOf(const BindingInfo& info, Mesh mesh,
                                     Rig rig) {
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

bool AllWithin(std::span<const int64_t> numbers, int64_t limit) {
  return std::all_of(numbers.begin(), numbers.end(),
                     [&](int64_t n) { return n >= 0 && n < limit; });
}

// InvalidArgument BAD_ANSWER unless the parts fit together, so that deforming
// reads no more than there is.
absl::Status CheckFits(const BindingInfo& info, const Mesh& mesh,
                       const Rig& rig) {
  DEFORM_ASSIGN_OR_RETURN(const CoordinateScheme* const scheme,
                          FindScheme(info.scheme));
  const Cage* const cage = std::get_if<Cage>(&rig);
  const int64_t faces = cage != nullptr ? cage->face_count() : 0;
  bool fits = info.normal_count == (scheme->uses_normals() ? faces : 0) &&
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

// InvalidArgument BAD_ANSWER unless the rows are those that come next.
absl::Status SetRows(const WeightRows& rows, int64_t next,
                     WeightTiles& weights) {
  const int64_t count = rows.vertex.rows();
  if (rows.first_point != next || count > weights.points() - next ||
      rows.vertex.cols() + rows.normal.cols() != weights.columns()) {
    return InvalidInput("BAD_ANSWER", "weights",
                        "the server sent other weights than it told of");
  }
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t c = 0; c < rows.vertex.cols(); ++c) {
      weights.set(next + i, c, static_cast<float>(rows.vertex(i, c)));
    }
    for (int64_t c = 0; c < rows.normal.cols(); ++c) {
      weights.set(next + i, rows.vertex.cols() + c,
                  static_cast<float>(rows.normal(i, c)));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status Client::GetWeights(
    absl::string_view binding_id, WeightPrecision precision, int64_t first,
    int64_t count, absl::FunctionRef<absl::Status(const WeightRows&)> rows) {
  v1::GetWeightsRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_binding_id(ToString(binding_id));
  request.set_precision(precision == WeightPrecision::kRecomputedFloat64
                            ? v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64
                            : v1::WEIGHT_PRECISION_CACHED_FLOAT32);
  request.set_first_point(first);
  request.set_point_count(count);
  grpc::ClientContext context;
  const auto call = impl_->bindings->GetWeights(&context, request);
  v1::GetWeightsResponse response;
  absl::Status status;
  while (call->Read(&response)) {
    if (!status.ok()) continue;  // The cancelled call is read to its end.
    const absl::StatusOr<WeightRows> part = FromProto(response);
    status = part.ok() ? rows(*part) : part.status();
    if (!status.ok()) context.TryCancel();
  }
  const absl::Status end = FromGrpc(call->Finish());
  return status.ok() ? end : status;
}

absl::StatusOr<ModelArrays> Client::DownloadModel(
    absl::string_view model_id, const ProgressCallback& progress) {
  v1::DownloadModelRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_model_id(ToString(model_id));
  grpc::ClientContext context;
  const auto call = impl_->models->DownloadModel(&context, request);
  v1::DownloadModelResponse response;
  ModelDownload download;
  absl::Status status;
  while (call->Read(&response)) {
    if (!status.ok()) continue;  // The cancelled call is read to its end.
    status = download.Add(response);
    if (!status.ok() ||
        (progress && !progress(download.received(), download.total()))) {
      context.TryCancel();
    }
  }
  const absl::Status end = FromGrpc(call->Finish());
  DEFORM_RETURN_IF_ERROR(status.ok() ? end : status);
  return std::move(download).Finish();
}

absl::StatusOr<HeldBinding> Client::DownloadBinding(
    absl::string_view binding_id, const ProgressCallback& progress) {
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo info, GetBinding(binding_id));
  DEFORM_ASSIGN_OR_RETURN(ModelArrays arrays, DownloadModel(info.model_id));
  DEFORM_ASSIGN_OR_RETURN(
      Mesh mesh, Mesh::Create(arrays.dimension, std::move(arrays.positions),
                              std::move(arrays.faces)));
  DEFORM_ASSIGN_OR_RETURN(const RigArrays rig_arrays, GetRig(binding_id));
  DEFORM_ASSIGN_OR_RETURN(Rig rig, RigOf(rig_arrays));
  DEFORM_RETURN_IF_ERROR(CheckFits(info, mesh, rig));
  const int64_t points = mesh.size();
  DEFORM_ASSIGN_OR_RETURN(BindingFacts facts,
                          FactsOf(info, std::move(mesh), std::move(rig)));
  WeightTiles weights(points, facts.column_count());
  int64_t done = 0;
  const auto keep = [&](const WeightRows& rows) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(SetRows(rows, done, weights));
    done += rows.vertex.rows();
    if (progress && !progress(done, points)) {
      return absl::CancelledError("given up by the caller");
    }
    return absl::OkStatus();
  };
  DEFORM_RETURN_IF_ERROR(
      GetWeights(binding_id, WeightPrecision::kCachedFloat32, 0, 0, keep));
  if (done != points) {
    return InvalidInput("BAD_ANSWER", "weights",
                        "the server sent fewer weights than it told of");
  }
  return HeldBinding{info.binding_id,
                     std::make_shared<const Binding>(
                         std::move(facts), std::make_shared<const WeightTiles>(
                                               std::move(weights)))};
}

}  // namespace deform
