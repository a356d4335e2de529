#include "server/rpc/server_service.h"

#include <thread>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/models/names.h"
#include "server/rpc/process_usage.h"

namespace deform::server {

grpc::Status ServerService::GetServerStatus(
    grpc::ServerContext* context, const v1::GetServerStatusRequest* /*request*/,
    v1::GetServerStatusResponse* response) {
  return calls_.Run("GetServerStatus", *context, [&]() -> absl::Status {
    v1::ServerStatus& status = *response->mutable_status();
    status.set_version(DEFORM_VERSION);
    status.set_uptime_seconds(
        std::chrono::duration<double>(rooms_.sessions.clock()() - start_)
            .count());
    const ProcessUsage usage = ReadProcessUsage();
    status.set_cpu_seconds(usage.cpu_seconds);
    status.set_resident_bytes(usage.resident_bytes);
    status.set_open_files(usage.open_files);
    status.set_processors(std::thread::hardware_concurrency());
    status.set_models(rooms_.models.catalogue().size());
    status.set_bindings(rooms_.bindings.catalogue().size());
    status.set_sessions(rooms_.sessions.catalogue().size());
    uint64_t participants = 0;
    for (const auto& session : rooms_.sessions.catalogue().All()) {
      participants += session->state().participants;
    }
    status.set_participants(participants);
    const StreamCounters& counters = streams_.counters();
    status.set_frames_sent(counters.frames());
    status.set_frame_bytes_sent(counters.frame_bytes());
    status.set_poses_accepted(counters.poses_accepted());
    status.set_poses_rejected(counters.poses_rejected());
    return absl::OkStatus();
  });
}

grpc::Status ServerService::Backup(grpc::ServerContext* context,
                                   const v1::BackupRequest* request,
                                   v1::BackupResponse* response) {
  return calls_.Run("Backup", *context, [&]() -> absl::Status {
    // Nobody chooses a path on the server's machine.
    DEFORM_RETURN_IF_ERROR(CheckName(request->name(), "name"));
    DEFORM_ASSIGN_OR_RETURN(std::string directory,
                            rooms_.backups.Make(request->name()));
    response->set_directory(std::move(directory));
    return absl::OkStatus();
  });
}

grpc::Status ServerService::CollectOrphans(
    grpc::ServerContext* context, const v1::CollectOrphansRequest* /*request*/,
    v1::CollectOrphansResponse* response) {
  return calls_.Run("CollectOrphans", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const int64_t removed,
                            rooms_.models.store().CollectOrphans());
    response->set_files_removed(static_cast<uint64_t>(removed));
    return absl::OkStatus();
  });
}

}  // namespace deform::server
