#include "server/rpc/session_service.h"

#include "core/base/status_macros.h"
#include "server/rpc/convert.h"

namespace deform::server {

grpc::Status SessionService::CreateSession(
    grpc::ServerContext* context, const v1::CreateSessionRequest* request,
    v1::CreateSessionResponse* response) {
  return calls_.Run("CreateSession", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const auto session,
        sessions_.Create(tenant, request->binding_id(), request->session_id(),
                         [&] { return !context->IsCancelled(); }));
    ToProto(session->state(), response->mutable_session());
    return absl::OkStatus();
  });
}

grpc::Status SessionService::GetSession(grpc::ServerContext* context,
                                        const v1::GetSessionRequest* request,
                                        v1::GetSessionResponse* response) {
  return calls_.Run("GetSession", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const auto session,
        sessions_.catalogue().Find(tenant, request->session_id()));
    ToProto(session->state(), response->mutable_session());
    return absl::OkStatus();
  });
}

grpc::Status SessionService::ListSessions(
    grpc::ServerContext* context, const v1::ListSessionsRequest* request,
    v1::ListSessionsResponse* response) {
  return calls_.Run("ListSessions", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const PageRequest wanted,
        ToPageRequest(request->page_size(), request->page_token()));
    const auto page = sessions_.catalogue().List(
        tenant, wanted, [](const Session&) { return true; });
    for (const auto& session : page.records) {
      ToProto(session->state(), response->add_sessions());
    }
    response->set_next_page_token(page.next);
    return absl::OkStatus();
  });
}

grpc::Status SessionService::DeleteSession(
    grpc::ServerContext* context, const v1::DeleteSessionRequest* request,
    v1::DeleteSessionResponse* /*response*/) {
  return calls_.Run("DeleteSession", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    return sessions_.Delete(tenant, request->session_id());
  });
}

}  // namespace deform::server
