#include "server/rpc/binding_service.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <utility>

#include "core/base/status_macros.h"
#include "core/weights/scheme.h"
#include "server/rpc/await_binding.h"
#include "server/rpc/convert.h"
#include "server/rpc/quality.h"
#include "server/rpc/weight_rows.h"

namespace deform::server {
namespace {

using BindingWriter = PeerWriter<v1::CreateBindingResponse>;

bool WriteProgress(const BindProgress& progress, BindingWriter& peer) {
  v1::CreateBindingResponse message;
  ToProto(progress, message.mutable_progress());
  return peer.Write(message);
}

// The rows of `range`, computed at the priority of `pool`.
absl::StatusOr<v1::GetWeightsResponse> RowsAgain(const BindingFacts& binding,
                                                 const PointRange& range,
                                                 ThreadPool& pool) {
  std::packaged_task<absl::StatusOr<v1::GetWeightsResponse>()> task(
      [&] { return RecomputedRows(binding, range); });
  auto rows = task.get_future();
  pool.Submit([&] { task(); });
  return rows.get();
}

// Measures with the priority of `pool`, telling progress. What the task refers
// to is the caller's, so a caller who has left is waited for: a block of points
// at most.
absl::StatusOr<Quality> Measure(const QualityTask& what, ThreadPool& pool,
                                PeerWriter<v1::GetQualityResponse>& peer) {
  Cancellation cancellation;
  std::atomic<int64_t> points_done = 0;
  const auto task =
      std::make_shared<std::packaged_task<absl::StatusOr<Quality>()>>([&] {
        return MeasureQuality(what, {.pool = &pool,
                                     .cancellation = &cancellation,
                                     .points_done = &points_done});
      });
  auto quality = task->get_future();
  pool.Submit([task] { (*task)(); });
  auto told_at = std::chrono::steady_clock::now() - kProgressInterval;
  while (quality.wait_for(kPollInterval) != std::future_status::ready) {
    if (peer.IsGone()) cancellation.Cancel();
    const auto now = std::chrono::steady_clock::now();
    if (!what.posed || now - told_at < kProgressInterval) continue;
    told_at = now;
    v1::GetQualityResponse message;
    message.mutable_progress()->set_points_done(points_done);
    message.mutable_progress()->set_points_total(
        PointsToMeasure(what.facts, *what.posed));
    if (!peer.Write(message)) cancellation.Cancel();
  }
  return quality.get();
}

}  // namespace

void BindingService::Describe(const BindingRecord& record, Detail detail,
                              v1::Binding* out) {
  // Asked before the form: who has been compressed meanwhile is not dense.
  const auto compressing = bindings_.compressor().ProgressOf(record);
  ToProto(record, detail, out);
  if (compressing && out->weight_form() == v1::WEIGHT_FORM_DENSE) {
    out->set_weight_form(v1::WEIGHT_FORM_COMPRESSING);
    ToProto(*compressing, out->mutable_progress());
  }
  if (const auto progress = bindings_.ProgressOf(record)) {
    out->set_weight_state(v1::WEIGHT_STATE_COMPUTING);
    ToProto(*progress, out->mutable_progress());
  }
}

absl::StatusOr<std::shared_ptr<const Mesh>> BindingService::BoxedModel(
    const v1::CreateBindingRequest& request) const {
  if (!request.add_box_handles()) return nullptr;
  DEFORM_ASSIGN_OR_RETURN(const std::string tenant, TenantOr(request.tenant()));
  DEFORM_ASSIGN_OR_RETURN(
      const auto record,
      bindings_.models().catalogue().Find(tenant, request.model_id()));
  return record->mesh;
}

grpc::Status BindingService::CreateBinding(
    grpc::ServerContext* context, const v1::CreateBindingRequest* request,
    grpc::ServerWriter<v1::CreateBindingResponse>* writer) {
  return calls_.Run("CreateBinding", *context, [&]() -> absl::Status {
    BindingWriter peer(calls_, *context, *writer);
    DEFORM_ASSIGN_OR_RETURN(const auto model, BoxedModel(*request));
    DEFORM_ASSIGN_OR_RETURN(
        BindSpec spec, FromProto(*request, model.get(), weight_tolerance_));
    DEFORM_ASSIGN_OR_RETURN(const auto waiter,
                            bindings_.Create(std::move(spec)));
    DEFORM_ASSIGN_OR_RETURN(
        const CreatedBinding created,
        AwaitBinding(*waiter, *context, [&](const BindProgress& progress) {
          return WriteProgress(progress, peer);
        }));
    v1::CreateBindingResponse message;
    Describe(*created.record, Detail::kFull, message.mutable_binding());
    message.mutable_binding()->set_existed(created.existed);
    peer.Write(message);
    return absl::OkStatus();
  });
}

grpc::Status BindingService::GetBinding(grpc::ServerContext* context,
                                        const v1::GetBindingRequest* request,
                                        v1::GetBindingResponse* response) {
  return calls_.Run("GetBinding", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const auto record, Find(*request));
    Describe(*record, Detail::kFull, response->mutable_binding());
    if (request->with_rig()) {
      ToProto(record->facts.rig(), response->mutable_rig());
    }
    return absl::OkStatus();
  });
}

grpc::Status BindingService::ListBindings(
    grpc::ServerContext* context, const v1::ListBindingsRequest* request,
    v1::ListBindingsResponse* response) {
  return calls_.Run("ListBindings", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const PageRequest wanted,
        ToPageRequest(request->page_size(), request->page_token()));
    const auto page = bindings_.catalogue().List(
        tenant, wanted, [&](const BindingRecord& record) {
          return request->model_id().empty() ||
                 record.model_id == request->model_id();
        });
    for (const auto& record : page.records) {
      Describe(*record, Detail::kSummary, response->add_bindings());
    }
    response->set_next_page_token(page.next);
    return absl::OkStatus();
  });
}

grpc::Status BindingService::DeleteBinding(
    grpc::ServerContext* context, const v1::DeleteBindingRequest* request,
    v1::DeleteBindingResponse* /*response*/) {
  return calls_.Run("DeleteBinding", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    return bindings_.Remove(tenant, request->binding_id());
  });
}

grpc::Status BindingService::GetWeights(
    grpc::ServerContext* context, const v1::GetWeightsRequest* request,
    grpc::ServerWriter<v1::GetWeightsResponse>* writer) {
  return calls_.Run("GetWeights", *context, [&]() -> absl::Status {
    PeerWriter<v1::GetWeightsResponse> peer(calls_, *context, *writer);
    DEFORM_ASSIGN_OR_RETURN(const auto record, Find(*request));
    const auto is_wanted = [&] { return !peer.IsGone(); };
    const bool again =
        request->precision() == v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64;
    DEFORM_ASSIGN_OR_RETURN(PointRange left,
                            WantedPoints(*request, record->facts));
    std::shared_ptr<const Binding> cached;
    if (!again) {
      DEFORM_ASSIGN_OR_RETURN(cached, bindings_.WeightsOf(record, is_wanted));
    }
    const int64_t at_once =
        PointsPerMessage(record->facts, request->precision());
    while (left.count > 0) {
      if (!is_wanted()) return absl::CancelledError();
      const PointRange block{left.first, std::min(at_once, left.count)};
      DEFORM_ASSIGN_OR_RETURN(const v1::GetWeightsResponse rows,
                              again
                                  ? RowsAgain(record->facts, block, background_)
                                  : CachedRows(*cached, block));
      if (!peer.Write(rows)) return absl::CancelledError();
      left.first += block.count;
      left.count -= block.count;
    }
    return absl::OkStatus();
  });
}

grpc::Status BindingService::GetQuality(
    grpc::ServerContext* context, const v1::GetQualityRequest* request,
    grpc::ServerWriter<v1::GetQualityResponse>* writer) {
  return calls_.Run("GetQuality", *context, [&]() -> absl::Status {
    PeerWriter<v1::GetQualityResponse> peer(calls_, *context, *writer);
    DEFORM_ASSIGN_OR_RETURN(const auto record, Find(*request));
    DEFORM_ASSIGN_OR_RETURN(
        QualityTask task,
        ToQualityTask(*request, record->tenant, *record, sessions_));
    if (task.posed) {
      DEFORM_ASSIGN_OR_RETURN(task.binding, bindings_.WeightsOf(record, [&] {
        return !peer.IsGone();
      }));
    }
    DEFORM_ASSIGN_OR_RETURN(const Quality quality,
                            Measure(task, background_, peer));
    v1::GetQualityResponse message;
    *message.mutable_report() = ToProto(quality);
    if (!peer.Write(message)) return absl::CancelledError();
    const int64_t points = request->with_points() && quality.pose
                               ? std::ssize(quality.pose->points)
                               : 0;
    for (int64_t i = 0; i < points; i += kQualityPointsPerMessage) {
      *message.mutable_points() = ToProto(*quality.pose, i);
      if (!peer.Write(message)) return absl::CancelledError();
    }
    return absl::OkStatus();
  });
}

grpc::Status BindingService::ListSchemes(
    grpc::ServerContext* context, const v1::ListSchemesRequest* /*request*/,
    v1::ListSchemesResponse* response) {
  return calls_.Run("ListSchemes", *context, [&]() -> absl::Status {
    for (const CoordinateScheme* scheme : AllSchemes()) {
      ToProto(*scheme, response->add_schemes());
    }
    return absl::OkStatus();
  });
}

}  // namespace deform::server
