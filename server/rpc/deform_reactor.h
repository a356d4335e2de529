// One Deform stream: messages in, messages out, nothing computed.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <variant>

#include "absl/status/status.h"
#include "core/base/mutex.h"
#include "deform/v1/session.pb.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/byte_buffer.h"
#include "grpcpp/support/server_callback.h"
#include "server/rpc/stream_counters.h"
#include "server/sessions/session.h"
#include "server/sessions/session_manager.h"

namespace deform::server {

class DeformReactor;

// The open streams, and their owner. Thread-safe.
class DeformStreams {
 public:
  // `sessions` is borrowed. A peer that does not join within `stall_timeout`,
  // or takes no message for as long, is told so; one that does not take what is
  // left of an ended stream is cut off.
  DeformStreams(SessionManager& sessions,
                std::chrono::milliseconds stall_timeout)
      : sessions_(sessions), stall_timeout_(stall_timeout) {}

  // A reactor that lives until gRPC is done with it.
  DeformReactor* Open(grpc::CallbackServerContext* context);
  // Call it a few times a second.
  void CheckStalls();
  size_t size() const;
  const StreamCounters& counters() const { return counters_; }

 private:
  friend class DeformReactor;
  void Close(DeformReactor* reactor);

  SessionManager& sessions_;
  const std::chrono::milliseconds stall_timeout_;
  StreamCounters counters_;
  mutable Mutex mutex_;
  std::set<std::shared_ptr<DeformReactor>> reactors_ ABSL_GUARDED_BY(mutex_);
};

// Reads one message at a time and writes one at a time. gRPC's reactions and
// the session's wake-ups come on any thread; what they share is guarded, and
// operations of gRPC are started with the lock held, so that none starts after
// Finish().
class DeformReactor final
    : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
      public Receiver,
      public std::enable_shared_from_this<DeformReactor> {
 public:
  DeformReactor(DeformStreams& streams, grpc::CallbackServerContext* context);

  void Start();

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  void Wake() override;

  // See DeformStreams.
  void CheckStall(std::chrono::steady_clock::time_point now);

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  // What is being written, if it takes more than one message.
  struct InProgress {
    std::variant<FrameToSend, OrderToSend> what;
    size_t messages = 0;
    size_t next = 0;
  };

  void HandleMessage(const v1::DeformRequest& request);
  void HandleJoin(const v1::Join& join);
  void HandlePose(const v1::Pose& pose);
  // All others that may follow; false if it is none of them.
  static bool HandleRequest(Participant& participant,
                            const v1::DeformRequest& request);

  Participant* participant() const;
  // Starts what can be started: a read, a write, the end.
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void StartNextWrite() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Write(const v1::DeformResponse& response)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Of what is in progress.
  void WriteNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Ends the stream with `status`, told in-band too if nothing is being
  // written.
  void End(const absl::Status& status) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  DeformStreams& streams_;
  grpc::CallbackServerContext* const context_;
  const TimePoint begin_;

  grpc::ByteBuffer incoming_;  // Belongs to gRPC while reading.
  grpc::ByteBuffer outgoing_;  // Belongs to gRPC while writing.

  mutable Mutex mutex_;
  // Set once, by joining.
  std::unique_ptr<Participant> participant_ ABSL_GUARDED_BY(mutex_);
  std::optional<v1::Joined> joined_ ABSL_GUARDED_BY(mutex_);  // To be told.
  std::optional<InProgress> in_progress_ ABSL_GUARDED_BY(mutex_);
  bool reading_ ABSL_GUARDED_BY(mutex_) = false;
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool half_closed_ ABSL_GUARDED_BY(mutex_) = false;
  // Set by Finish().
  std::optional<absl::Status> finished_ ABSL_GUARDED_BY(mutex_);
  // Set by OnDone(), after which the context is gone.
  bool done_ ABSL_GUARDED_BY(mutex_) = false;
  // When patience ends: with joining, then with ending.
  std::optional<TimePoint> deadline_ ABSL_GUARDED_BY(mutex_);
  uint64_t poses_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t frames_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace deform::server
