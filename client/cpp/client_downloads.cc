// What a client downloads: weights, models, and both together.
#include <chrono>
#include <thread>
#include <utility>

#include "client/cpp/basis_download.h"
#include "client/cpp/binding_download.h"
#include "client/cpp/client_impl.h"
#include "client/cpp/convert.h"
#include "client/cpp/model_download.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

// All that the call sends.
template <typename Part, typename Download>
absl::Status Receive(grpc::ClientContext& context,
                     grpc::ClientReader<Part>& call,
                     const ProgressCallback& progress, Download& download) {
  Part part;
  absl::Status status;
  while (call.Read(&part)) {
    if (!status.ok()) continue;  // The cancelled call is read to its end.
    status = download.Add(part);
    if (!status.ok() ||
        (progress && !progress(download.received(), download.total()))) {
      context.TryCancel();
    }
  }
  const absl::Status end = FromGrpc(call.Finish());
  return status.ok() ? end : status;
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
  ModelDownload download;
  DEFORM_RETURN_IF_ERROR(
      Receive(context, *impl_->models->DownloadModel(&context, request),
              progress, download));
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
  DEFORM_ASSIGN_OR_RETURN(BindingFacts facts,
                          FactsOf(info, std::move(mesh), std::move(rig)));
  WeightsDownload download(facts.point_count(), facts.column_count());
  const auto keep = [&](const WeightRows& rows) -> absl::Status {
    DEFORM_RETURN_IF_ERROR(download.Add(rows));
    if (progress && !progress(download.received(), download.total())) {
      return absl::CancelledError("given up by the caller");
    }
    return absl::OkStatus();
  };
  DEFORM_RETURN_IF_ERROR(
      GetWeights(binding_id, WeightPrecision::kCachedFloat32, 0, 0, keep));
  DEFORM_ASSIGN_OR_RETURN(auto weights, std::move(download).Finish());
  return HeldBinding{
      info.binding_id,
      std::make_shared<const Binding>(std::move(facts), std::move(weights))};
}

absl::StatusOr<HeldBasis> Client::DownloadBasis(
    absl::string_view binding_id, const ProgressCallback& progress,
    const HeldBasis& known) {
  DEFORM_RETURN_IF_ERROR(AwaitForm(binding_id, progress));
  v1::DownloadBasisRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_binding_id(ToString(binding_id));
  request.set_known_basis_id(known.basis_id);
  grpc::ClientContext context;
  BasisDownload download;
  DEFORM_RETURN_IF_ERROR(
      Receive(context, *impl_->bindings->DownloadBasis(&context, request),
              progress, download));
  return download.Finish(known);
}

absl::Status Client::AwaitForm(absl::string_view binding_id,
                               const ProgressCallback& progress) {
  constexpr std::chrono::milliseconds kLook{100};
  while (true) {
    DEFORM_ASSIGN_OR_RETURN(const BindingInfo info, GetBinding(binding_id));
    if (info.weight_form != WeightForm::kCompressing) return absl::OkStatus();
    if (progress && !progress(info.points_done, info.points_total)) {
      return absl::CancelledError("given up by the caller");
    }
    std::this_thread::sleep_for(kLook);
  }
}

}  // namespace deform
