// What a Client is made of; for client*.cc only.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <chrono>
#include <memory>
#include <string>

#include "client/cpp/client.h"
#include "client/cpp/status.h"
#include "core/base/status_macros.h"
#include "deform/v1/binding.grpc.pb.h"
#include "deform/v1/model.grpc.pb.h"
#include "deform/v1/server.grpc.pb.h"
#include "deform/v1/session.grpc.pb.h"

namespace deform {

inline std::string ToString(absl::string_view text) {
  return std::string(text.data(), text.size());
}

struct Client::Impl {
  Impl(std::shared_ptr<grpc::Channel> shared, const ClientOptions& chosen)
      : channel(std::move(shared)),
        options(chosen),
        models(v1::ModelService::NewStub(channel)),
        bindings(v1::BindingService::NewStub(channel)),
        sessions(v1::SessionService::NewStub(channel)),
        server(v1::ServerService::NewStub(channel)) {}

  // A call without work behind it.
  template <typename Stub, typename Method, typename Request, typename Response>
  absl::Status Call(Stub& stub, Method method, const Request& request,
                    Response* response) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(std::chrono::system_clock::now() +
                         options.call_timeout);
    return FromGrpc((stub.*method)(&context, request, response));
  }

  // All pages of a list; `read` takes one.
  template <typename Response, typename Stub, typename Method, typename Request,
            typename Read>
  absl::Status CallPages(Stub& stub, Method method, Request request,
                         Read read) {
    request.set_tenant(options.tenant);
    do {
      Response response;
      DEFORM_RETURN_IF_ERROR(Call(stub, method, request, &response));
      read(response);
      request.set_page_token(response.next_page_token());
    } while (!request.page_token().empty());
    return absl::OkStatus();
  }

  absl::StatusOr<v1::GetBindingResponse> GetBinding(
      absl::string_view binding_id, bool with_rig) {
    v1::GetBindingRequest request;
    request.set_tenant(options.tenant);
    request.set_binding_id(ToString(binding_id));
    request.set_with_rig(with_rig);
    v1::GetBindingResponse response;
    DEFORM_RETURN_IF_ERROR(Call(
        *bindings, &v1::BindingService::Stub::GetBinding, request, &response));
    return response;
  }

  const std::shared_ptr<grpc::Channel> channel;
  const ClientOptions options;
  const std::unique_ptr<v1::ModelService::Stub> models;
  const std::unique_ptr<v1::BindingService::Stub> bindings;
  const std::unique_ptr<v1::SessionService::Stub> sessions;
  const std::unique_ptr<v1::ServerService::Stub> server;
};

}  // namespace deform
