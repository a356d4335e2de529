// How a DeformStream goes on over several connections; for client.cc and
// deform_stream*.cc only.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/cpp/backoff.h"
#include "client/cpp/convert.h"
#include "client/cpp/deform_link.h"
#include "client/cpp/deform_stream.h"
#include "client/cpp/frame_assembler.h"
#include "client/cpp/unanswered.h"
#include "core/base/mutex.h"
#include "deform/v1/session.grpc.pb.h"

namespace deform {

// What is asked goes into a queue, and whoever finds nobody at it sends what is
// there: as a rule the caller of Send(). It stays until it is answered. The
// receiving thread notices when the connection breaks, joins again, and has
// what the server did not accept sent again.
class DeformStream::Impl {
 public:
  // `join` says how.
  Impl(std::shared_ptr<v1::SessionService::Stub> stub, v1::Join join,
       const DeformOptions& options);
  ~Impl();

  // The first call. Waits for the server's answer.
  absl::Status Join();

  // The sending side.
  absl::StatusOr<uint64_t> Send(const PoseUpdate& update,
                                const PoseOptions& options);
  // `request` lacks its sequence.
  absl::StatusOr<uint64_t> Ask(v1::DeformRequest request);
  // It wants no answer.
  absl::Status Tell(v1::DeformRequest request);
  void Close();
  uint64_t told_changes() const { return told_changes_; }

  // The receiving side.
  absl::Status NextFrame(Frame& frame);
  absl::Status Hold(const HeldBinding& weights);
  absl::Status Hold(const HeldBasis& basis);
  const std::vector<RigChange>& rig_changes() const { return rig_changes_; }
  const std::vector<ParticipantInfo>& participants() const {
    return participants_;
  }
  const std::optional<CurrentPose>& conflict() const { return conflict_; }
  uint64_t rejected_sequence() const { return rejected_sequence_; }
  int64_t reconnections() const { return reconnections_; }
  bool ended() const { return ended_; }

  const JoinedSession& joined() const { return joined_; }
  void Cancel();

 private:
  // Tells the server of `join_.held`.
  absl::Status TellHeld();
  absl::Status Queue(uint64_t sequence, v1::DeformRequest request);
  // Sends what is unsent, unless another thread does.
  void Drain() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void DrainAsTheOne() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // What came last: what NextFrame() returns, if that is it.
  std::optional<absl::Status> Handle(Frame& frame);
  std::optional<absl::Status> HandleFrame(Frame& frame);
  std::optional<absl::Status> HandleRejection();
  void HandleParticipants();
  // What came cannot be: ends the stream with this.
  absl::Status Refuse(const absl::Status& status);
  absl::Status End(const absl::Status& status);

  // The connection ended with `reason`: joins again, or says why not.
  absl::Status Reconnect(absl::Status reason);
  absl::Status TryToReconnect();
  // Of the session, as far as it was told.
  const std::string& binding_id() const;
  absl::Status Adopt(std::shared_ptr<DeformLink> link,
                     const v1::Joined& joined);
  // False if it was cancelled meanwhile.
  bool Sleep(std::chrono::milliseconds time);

  const std::shared_ptr<v1::SessionService::Stub> stub_;
  const DeformOptions options_;
  v1::Join join_;
  JoinedSession joined_;  // By the first connection.

  // How many of rig_changes_ the caller of NextFrame() knows of.
  std::atomic<uint64_t> told_changes_{0};

  // The sending thread's.
  uint64_t sequence_ = 0;

  // The receiving thread's.
  std::shared_ptr<DeformLink> reader_;
  HeldWeights weights_;
  std::optional<FrameAssembler> assembler_;  // Refers to the weights.
  v1::DeformResponse response_;              // Kept for its buffers.
  std::optional<uint64_t> last_revision_;
  uint64_t last_epoch_ = 0;  // Of the last frame.
  uint64_t epoch_ = 0;       // Of the session, when it was joined.
  uint64_t last_answered_ = 0;
  bool may_repeat_ = false;  // The next frame may be one that is known.
  uint64_t rejected_sequence_ = 0;
  std::optional<CurrentPose> conflict_;
  std::vector<RigChange> rig_changes_;
  std::map<uint64_t, ParticipantInfo> known_;
  std::vector<ParticipantInfo> participants_;
  Backoff backoff_;
  int64_t reconnections_ = 0;
  absl::Status end_;
  bool ended_ = false;

  Mutex mutex_;
  CondVar cancelled_changed_;
  std::shared_ptr<DeformLink> link_ ABSL_GUARDED_BY(mutex_);
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // Writing to it failed.
  Unanswered unanswered_ ABSL_GUARDED_BY(mutex_);
  uint64_t change_base_ ABSL_GUARDED_BY(mutex_) = 0;  // Of rig changes.
  std::optional<v1::DeformRequest> shown_ ABSL_GUARDED_BY(mutex_);
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool writes_done_ ABSL_GUARDED_BY(mutex_) = false;
  bool over_ ABSL_GUARDED_BY(mutex_) = false;
  bool cancelled_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread resender_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform
