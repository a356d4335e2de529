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
#include "grpcpp/support/sync_stream.h"
#include "server/sessions/session.h"

namespace deform::server {

// Runs the bodies of calls, and ends those whose peer stands still.
// Thread-safe.
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

  // While it lives, a thread waits for the peer of a call to read or to send.
  // If that takes longer than the stall timeout the call is cancelled.
  class PeerWait {
   public:
    PeerWait(CallRunner& calls, grpc::ServerContext& context);
    ~PeerWait();
    PeerWait(const PeerWait&) = delete;
    PeerWait& operator=(const PeerWait&) = delete;

   private:
    friend class CallRunner;
    CallRunner& calls_;
    grpc::ServerContext& context_;
    const std::chrono::steady_clock::time_point since_;
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
  std::set<const PeerWait*> waits_ ABSL_GUARDED_BY(mutex_);
};

// A stream to the peer of a call. All it is made from is borrowed.
template <typename Message>
class PeerWriter {
 public:
  PeerWriter(CallRunner& calls, grpc::ServerContext& context,
             grpc::ServerWriter<Message>& writer)
      : calls_(calls), context_(context), writer_(writer) {}

  // False: the peer is gone, or did not read for the stall timeout.
  bool Write(const Message& message) {
    const CallRunner::PeerWait wait(calls_, context_);
    return writer_.Write(message);
  }
  bool IsGone() const { return context_.IsCancelled(); }

 private:
  CallRunner& calls_;
  grpc::ServerContext& context_;
  grpc::ServerWriter<Message>& writer_;
};

// A stream from the peer of a call. All it is made from is borrowed.
template <typename Message>
class PeerReader {
 public:
  PeerReader(CallRunner& calls, grpc::ServerContext& context,
             grpc::ServerReader<Message>& reader)
      : calls_(calls), context_(context), reader_(reader) {}

  // False: the stream has ended, or nothing came for the stall timeout.
  bool Read(Message* message) {
    const CallRunner::PeerWait wait(calls_, context_);
    return reader_.Read(message);
  }

 private:
  CallRunner& calls_;
  grpc::ServerContext& context_;
  grpc::ServerReader<Message>& reader_;
};

// One log line about a call that has ended.
void LogCall(absl::string_view call, const std::string& peer,
             const absl::Status& status, std::chrono::nanoseconds latency);

}  // namespace deform::server
