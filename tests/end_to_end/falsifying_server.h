// A server that passes everything on to another, but alters frames.
#pragma once

#include <grpcpp/grpcpp.h>

#include <cstring>
#include <memory>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "deform/v1/binding.grpc.pb.h"
#include "deform/v1/model.grpc.pb.h"
#include "deform/v1/session.grpc.pb.h"

namespace deform {

// From revision `from_revision` on, x of vertex `vertex` is `off` more than it
// is. Knows the calls that a load run makes, but not how a server is: there is
// no GetServerStatus, as with servers of an older version.
class FalsifyingServer {
 public:
  struct Lie {
    uint64_t from_revision = 0;
    int64_t vertex = 0;
    float off = 0;
  };

  FalsifyingServer(const std::string& address, const Lie& lie)
      : channel_(
            grpc::CreateChannel(address, grpc::InsecureChannelCredentials())),
        models_(channel_),
        bindings_(channel_),
        sessions_(channel_, lie) {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(),
                             &port);
    builder.RegisterService(&models_);
    builder.RegisterService(&bindings_);
    builder.RegisterService(&sessions_);
    server_ = builder.BuildAndStart();
    address_ = absl::StrCat("127.0.0.1:", port);
  }

  const std::string& address() const { return address_; }

 private:
  struct Models final : v1::ModelService::Service {
    explicit Models(const std::shared_ptr<grpc::Channel>& channel)
        : stub(v1::ModelService::NewStub(channel)) {}
    grpc::Status RegisterModel(
        grpc::ServerContext*,
        grpc::ServerReader<v1::RegisterModelRequest>* requests,
        v1::RegisterModelResponse* response) override {
      grpc::ClientContext context;
      const auto call = stub->RegisterModel(&context, response);
      v1::RegisterModelRequest request;
      while (requests->Read(&request)) call->Write(request);
      call->WritesDone();
      return call->Finish();
    }
    grpc::Status DeleteModel(grpc::ServerContext*,
                             const v1::DeleteModelRequest* request,
                             v1::DeleteModelResponse* response) override {
      grpc::ClientContext context;
      return stub->DeleteModel(&context, *request, response);
    }
    const std::unique_ptr<v1::ModelService::Stub> stub;
  };

  struct Bindings final : v1::BindingService::Service {
    explicit Bindings(const std::shared_ptr<grpc::Channel>& channel)
        : stub(v1::BindingService::NewStub(channel)) {}
    grpc::Status CreateBinding(
        grpc::ServerContext*, const v1::CreateBindingRequest* request,
        grpc::ServerWriter<v1::CreateBindingResponse>* responses) override {
      grpc::ClientContext context;
      const auto call = stub->CreateBinding(&context, *request);
      v1::CreateBindingResponse response;
      while (call->Read(&response)) responses->Write(response);
      return call->Finish();
    }
    grpc::Status DeleteBinding(grpc::ServerContext*,
                               const v1::DeleteBindingRequest* request,
                               v1::DeleteBindingResponse* response) override {
      grpc::ClientContext context;
      return stub->DeleteBinding(&context, *request, response);
    }
    const std::unique_ptr<v1::BindingService::Stub> stub;
  };

  struct Sessions final : v1::SessionService::Service {
    Sessions(const std::shared_ptr<grpc::Channel>& channel, const Lie& what)
        : stub(v1::SessionService::NewStub(channel)), lie(what) {}
    grpc::Status CreateSession(grpc::ServerContext*,
                               const v1::CreateSessionRequest* request,
                               v1::CreateSessionResponse* response) override {
      grpc::ClientContext context;
      return stub->CreateSession(&context, *request, response);
    }
    grpc::Status DeleteSession(grpc::ServerContext*,
                               const v1::DeleteSessionRequest* request,
                               v1::DeleteSessionResponse* response) override {
      grpc::ClientContext context;
      return stub->DeleteSession(&context, *request, response);
    }
    grpc::Status Deform(
        grpc::ServerContext*,
        grpc::ServerReaderWriter<v1::DeformResponse, v1::DeformRequest>* stream)
        override {
      grpc::ClientContext context;
      const auto call = stub->Deform(&context);
      std::thread poses([&] {
        v1::DeformRequest request;
        while (stream->Read(&request) && call->Write(request)) {
        }
        call->WritesDone();
      });
      v1::DeformResponse response;
      while (call->Read(&response)) {
        if (response.has_frame()) Alter(*response.mutable_frame());
        if (!stream->Write(response)) context.TryCancel();
      }
      poses.join();
      return call->Finish();
    }
    void Alter(v1::FrameChunk& frame) const {
      const auto at = static_cast<size_t>(12 * lie.vertex);
      std::string& data = *frame.mutable_data();
      if (frame.revision() < lie.from_revision || at + 4 > data.size()) return;
      float x = 0;
      std::memcpy(&x, &data[at], 4);
      x += lie.off;
      std::memcpy(&data[at], &x, 4);
    }
    const std::unique_ptr<v1::SessionService::Stub> stub;
    const Lie lie;
  };

  const std::shared_ptr<grpc::Channel> channel_;
  Models models_;
  Bindings bindings_;
  Sessions sessions_;
  std::string address_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace deform
