// The services behind one listening port.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "core/base/thread_pool.h"
#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/sessions/session_manager.h"
#include "server/stores/backup_folder.h"

namespace deform::server {

// What the services work with; borrowed.
struct Rooms {
  ModelRegistry& models;
  BindingRegistry& bindings;
  SessionManager& sessions;
  ThreadPool& background;  // For long computations.
  BackupFolder& backups;
};

class GrpcServer {
 public:
  struct Options {
    std::string listen;  // HOST:PORT or unix:PATH; port 0 is any free one.
    // Threads for calls that wait for a thread's answer (all but Deform).
    int max_call_threads = 64;
    std::chrono::milliseconds stall_timeout{10000};
    double weight_tolerance = 0;  // Of bindings whose request names none.
  };

  // Serves from the moment this returns: the API, grpc.health.v1 and
  // reflection. Unavailable CANNOT_LISTEN.
  static absl::StatusOr<std::unique_ptr<GrpcServer>> Start(
      const Options& options, const Rooms& rooms);
  virtual ~GrpcServer() = default;

  // As clients dial it, with the port that was chosen.
  virtual const std::string& address() const = 0;

  // Turns NOT_SERVING, refuses new calls, ends the streams once their poses are
  // answered, and waits for what is running; cancels it when `patience` is
  // over. True if nothing had to be cancelled.
  virtual bool Drain(std::chrono::milliseconds patience) = 0;
};

}  // namespace deform::server
