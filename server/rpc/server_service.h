// deform.v1.ServerService: the server about itself.
#pragma once

#include <chrono>

#include "deform/v1/server.grpc.pb.h"
#include "server/rpc/calls.h"
#include "server/rpc/deform_reactor.h"
#include "server/rpc/grpc_server.h"

namespace deform::server {

class ServerService final : public v1::ServerService::Service {
 public:
  // All are borrowed.
  ServerService(CallRunner& calls, const Rooms& rooms,
                const DeformStreams& streams)
      : calls_(calls),
        rooms_(rooms),
        streams_(streams),
        start_(rooms.sessions.clock()()) {}

  grpc::Status GetServerStatus(grpc::ServerContext* context,
                               const v1::GetServerStatusRequest* request,
                               v1::GetServerStatusResponse* response) override;
  grpc::Status Backup(grpc::ServerContext* context,
                      const v1::BackupRequest* request,
                      v1::BackupResponse* response) override;
  grpc::Status CollectOrphans(grpc::ServerContext* context,
                              const v1::CollectOrphansRequest* request,
                              v1::CollectOrphansResponse* response) override;

 private:
  CallRunner& calls_;
  const Rooms rooms_;
  const DeformStreams& streams_;
  const std::chrono::steady_clock::time_point start_;
};

}  // namespace deform::server
