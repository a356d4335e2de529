// deform.v1.BindingService over the registry of bindings.
#pragma once

#include "core/base/thread_pool.h"
#include "deform/v1/binding.grpc.pb.h"
#include "server/models/binding_registry.h"
#include "server/rpc/calls.h"
#include "server/rpc/convert.h"
#include "server/sessions/session_manager.h"

namespace deform::server {

class BindingService final : public v1::BindingService::Service {
 public:
  // All are borrowed. `background` recomputes weights and measures quality;
  // `weight_tolerance` is that of requests which name none.
  BindingService(CallRunner& calls, BindingRegistry& bindings,
                 SessionManager& sessions, ThreadPool& background,
                 double weight_tolerance)
      : calls_(calls),
        bindings_(bindings),
        sessions_(sessions),
        background_(background),
        weight_tolerance_(weight_tolerance) {}

  grpc::Status CreateBinding(
      grpc::ServerContext* context, const v1::CreateBindingRequest* request,
      grpc::ServerWriter<v1::CreateBindingResponse>* writer) override;
  grpc::Status EditHandles(
      grpc::ServerContext* context, const v1::EditHandlesRequest* request,
      grpc::ServerWriter<v1::EditHandlesResponse>* writer) override;
  grpc::Status GetBinding(grpc::ServerContext* context,
                          const v1::GetBindingRequest* request,
                          v1::GetBindingResponse* response) override;
  grpc::Status ListBindings(grpc::ServerContext* context,
                            const v1::ListBindingsRequest* request,
                            v1::ListBindingsResponse* response) override;
  grpc::Status DeleteBinding(grpc::ServerContext* context,
                             const v1::DeleteBindingRequest* request,
                             v1::DeleteBindingResponse* response) override;
  grpc::Status GetWeights(
      grpc::ServerContext* context, const v1::GetWeightsRequest* request,
      grpc::ServerWriter<v1::GetWeightsResponse>* writer) override;
  grpc::Status DownloadBasis(
      grpc::ServerContext* context, const v1::DownloadBasisRequest* request,
      grpc::ServerWriter<v1::DownloadBasisResponse>* writer) override;
  grpc::Status GetQuality(
      grpc::ServerContext* context, const v1::GetQualityRequest* request,
      grpc::ServerWriter<v1::GetQualityResponse>* writer) override;
  grpc::Status ListSchemes(grpc::ServerContext* context,
                           const v1::ListSchemesRequest* request,
                           v1::ListSchemesResponse* response) override;

 private:
  // That a request names. InvalidArgument BAD_NAME, NotFound BINDING_NOT_FOUND.
  template <typename Request>
  absl::StatusOr<std::shared_ptr<const BindingRecord>> Find(
      const Request& request) const {
    const absl::StatusOr<std::string> tenant = TenantOr(request.tenant());
    if (!tenant.ok()) return tenant.status();
    return bindings_.catalogue().Find(*tenant, request.binding_id());
  }
  // With where its weights are.
  void Describe(const BindingRecord& record, Detail detail, v1::Binding* out);
  // The model whose box the request wants handles at; null if it wants none.
  absl::StatusOr<std::shared_ptr<const Mesh>> BoxedModel(
      const v1::CreateBindingRequest& request) const;

  CallRunner& calls_;
  BindingRegistry& bindings_;
  SessionManager& sessions_;
  ThreadPool& background_;
  const double weight_tolerance_;
};

}  // namespace deform::server
