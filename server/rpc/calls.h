// What every call has in common.
#pragma once

#include <chrono>
#include <optional>
#include <set>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/base/mutex.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/status.h"
#include "server/sessions/session.h"

namespace deform::server {

// Runs the bodies of calls and watches those that stream. Thread-safe.
class CallRunner {
 public:
  CallRunner(Clock clock, std::chrono::milliseconds stall_timeout)
      : clock_(std::move(clock)), stall_timeout_(stall_timeout) {}

  // Maps the outcome of `body` to the wire and writes one log line with the
  // call's latency. Running out of memory is ResourceExhausted OUT_OF_MEMORY.
  grpc::Status Run(absl::string_view call, const grpc::ServerContext& context,
                   absl::FunctionRef<absl::Status()> body);

  // From now on every call is refused with `status`.
  void Refuse(const absl::Status& status);
  // Calls that are running.
  int active() const;

  // A stream whose peer may stop reading or sending while a thread waits for
  // it: without a sign of life for the stall timeout the call is cancelled.
  class Watch {
   public:
    Watch(CallRunner& calls, grpc::ServerContext& context);
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

    void Progressed();

   private:
    friend class CallRunner;
    CallRunner& calls_;
    grpc::ServerContext& context_;
    std::chrono::steady_clock::time_point progress_;  // Guarded by calls_.
  };

  // Call it a few times a second.
  void CheckStalls();

 private:
  absl::Status Begin();
  void End();

  const Clock clock_;
  const std::chrono::milliseconds stall_timeout_;
  mutable Mutex mutex_;
  std::optional<absl::Status> refusal_ ABSL_GUARDED_BY(mutex_);
  int active_ ABSL_GUARDED_BY(mutex_) = 0;
  std::set<Watch*> watches_ ABSL_GUARDED_BY(mutex_);
};

// One log line about a call that has ended.
void LogCall(absl::string_view call, const std::string& peer,
             const absl::Status& status, std::chrono::nanoseconds latency);

}  // namespace deform::server
