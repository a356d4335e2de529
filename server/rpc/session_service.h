// deform.v1.SessionService over the sessions.
#pragma once

#include "deform/v1/session.grpc.pb.h"
#include "server/rpc/calls.h"
#include "server/rpc/deform_reactor.h"
#include "server/sessions/session_manager.h"

namespace deform::server {

// Deform handles bytes itself (see frame_message.h); the other calls are plain.
class SessionService final
    : public v1::SessionService::WithRawCallbackMethod_Deform<
          v1::SessionService::Service> {
 public:
  // All are borrowed.
  SessionService(CallRunner& calls, SessionManager& sessions,
                 DeformStreams& streams)
      : calls_(calls), sessions_(sessions), streams_(streams) {}

  grpc::Status CreateSession(grpc::ServerContext* context,
                             const v1::CreateSessionRequest* request,
                             v1::CreateSessionResponse* response) override;
  grpc::Status GetSession(grpc::ServerContext* context,
                          const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* response) override;
  grpc::Status ListSessions(grpc::ServerContext* context,
                            const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override;
  grpc::Status DeleteSession(grpc::ServerContext* context,
                             const v1::DeleteSessionRequest* request,
                             v1::DeleteSessionResponse* response) override;
  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* Deform(
      grpc::CallbackServerContext* context) override {
    return streams_.Open(context);
  }

 private:
  CallRunner& calls_;
  SessionManager& sessions_;
  DeformStreams& streams_;
};

}  // namespace deform::server
