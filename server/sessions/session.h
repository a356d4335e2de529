// One binding being posed by any number of participants.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "core/base/thread_pool.h"
#include "core/deform/deformer.h"
#include "core/frames/encoding.h"
#include "server/models/binding_registry.h"
#include "server/sessions/audience.h"
#include "server/sessions/batch_scheduler.h"
#include "server/sessions/frame.h"
#include "server/sessions/outbox.h"
#include "server/sessions/participant.h"
#include "server/sessions/pose_queue.h"
#include "server/sessions/rig_change.h"
#include "server/sessions/rig_history.h"

namespace deform::server {

// Never goes back; tests pass their own.
using Clock = std::function<std::chrono::steady_clock::time_point()>;

// What all sessions of a server share. Pointers are borrowed.
struct SessionEnvironment {
  BatchScheduler* scheduler = nullptr;  // Runs steps.
  Allowance* drags = &Unlimited();      // Of which fast drags take memory.
  Clock clock;
  int max_participants = 64;
  // How long a receiver may take to send one message.
  std::chrono::milliseconds stall_timeout{10000};
};

// A session as others see it.
struct SessionState {
  std::string tenant;
  std::string id;
  std::string binding_id;
  uint64_t revision = 0;
  uint64_t epoch = 0;
  int participants = 0;
  absl::Time create_time;
};

// Poses merge into a queue of steps; a step is run by the scheduler, one at a
// time: the deformer moves, the revision rises, the frame is encoded once per
// encoding in use and offered to every participant. Thread-safe; the lock is
// never held while deforming or encoding.
class Session : public std::enable_shared_from_this<Session> {
 public:
  // A participant's poses that may wait with Delivery::kEvery.
  static constexpr int64_t kMaxOwnSteps = 4;

  // Starts at the rest pose, revision 0.
  static std::shared_ptr<Session> Create(std::string id, BindingInUse binding,
                                         MemoryBudget::Reservation memory,
                                         const SessionEnvironment& environment);

  const std::string& id() const { return id_; }
  // Raised by every server that takes the session over.
  uint64_t epoch() const { return 1; }
  int dimension() const { return dimension_; }
  SessionState state() const;

  // The pose of the present revision, and the binding it belongs to.
  struct Posed {
    std::string binding_id;
    Pose pose;
  };
  Posed posed() const;

  struct Joined {
    std::unique_ptr<Participant> participant;
    SessionState state;
    std::shared_ptr<const Binding> binding;
    Pose pose;
  };
  // A frame of the present state follows. ResourceExhausted
  // TOO_MANY_PARTICIPANTS; after End() or Drain() their status.
  absl::StatusOr<Joined> Join(Delivery delivery, const FrameEncoding& encoding,
                              std::weak_ptr<Receiver> receiver);

  // Moves to the binding of edited handles, as a revision of its own, before
  // the poses that wait: these are taken over. Participants are told before the
  // first frame of it. The outcome goes to `move.done`.
  void Move(RigMove move);

  // If the weights of its binding have another form by now, changes over to it
  // before the next pose. That is no revision: who joins may see the present
  // one apart from others by the bound of compressed weights.
  void Refresh();

  // Ends every stream with `status` and lets the binding go.
  void End(const absl::Status& status);
  // Takes no more poses; ends every stream with `status` once the poses that
  // came are answered.
  void Drain(const absl::Status& status);

  // What is to be done next.
  struct Step {
    // None of these: only frames are wanted.
    std::optional<PoseQueue::Step> pose;
    std::optional<RigMove> move;
    std::shared_ptr<const Binding> refreshed;
    std::shared_ptr<const RigChange> change;  // What the move made.
    std::string binding_id;                   // Before it.
    std::vector<const FrameEncoding*> encodings;
    Deformer* deformer = nullptr;
    // Once the deformer has moved to the pose.
    DeformReport report;
    std::chrono::microseconds deform_time{0};
  };
  // For the scheduler: between these two calls the deformer moves to the pose.
  // The second encodes the frames, chunks in parallel on `pool` (may be null),
  // and hands them to the participants.
  Step BeginStep();
  void FinishStep(Step step, ThreadPool* pool);

  // Memory of a session of `binding`, roughly.
  static int64_t BytesFor(const BindingFacts& binding);

 private:
  friend class Participant;
  using Receivers = Audience::Receivers;

  // What is known of who sends poses from a seat of the audience.
  struct Sender {
    uint64_t first_change = 0;   // Changes of the rig before it joined.
    uint64_t last_sequence = 0;  // Of the poses accepted.
  };

  Session(std::string id, BindingInUse binding,
          MemoryBudget::Reservation memory,
          const SessionEnvironment& environment);

  SessionState StateLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The update as it is for the present rig.
  absl::StatusOr<PoseUpdate> CheckPose(const Sender& sender, uint64_t sequence,
                                       const absl::StatusOr<PoseUpdate>& update,
                                       uint64_t rig_changes) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool CanMove() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool CanStep() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Schedule() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static void Wake(const Receivers& receivers);

  absl::Status ChangeRig(Step& step, ThreadPool* pool);
  void ChangeForm(Step& step, ThreadPool* pool);
  void Describe(const Pose& pose, const DeformReport& report,
                std::chrono::microseconds time);
  Receivers Publish(Step& step, Audience::Frames frames);
  void PublishChange(Step& step) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string id_;
  const std::string tenant_;
  const int dimension_;
  const absl::Time create_time_;
  const SessionEnvironment environment_;

  // Used by the running step only; the queue of the scheduler hands them from
  // one to the next.
  std::unique_ptr<Deformer> deformer_;
  FrameInfo info_;

  mutable Mutex mutex_;
  MemoryBudget::Reservation memory_ ABSL_GUARDED_BY(mutex_);
  BindingCatalogue::Lease lease_ ABSL_GUARDED_BY(mutex_);
  std::string binding_id_ ABSL_GUARDED_BY(mutex_);
  std::shared_ptr<const Binding> binding_ ABSL_GUARDED_BY(mutex_);
  // The same weights in another form, to be changed over to.
  std::shared_ptr<const Binding> refreshed_ ABSL_GUARDED_BY(mutex_);
  std::deque<RigMove> moves_ ABSL_GUARDED_BY(mutex_);
  RigHistory rig_history_ ABSL_GUARDED_BY(mutex_);
  PoseQueue queue_ ABSL_GUARDED_BY(mutex_);
  bool scheduled_ ABSL_GUARDED_BY(mutex_) = false;
  uint64_t revision_ ABSL_GUARDED_BY(mutex_) = 0;
  Pose pose_ ABSL_GUARDED_BY(mutex_);  // Of the revision.
  std::optional<absl::Status> closed_ ABSL_GUARDED_BY(mutex_);
  Audience audience_ ABSL_GUARDED_BY(mutex_);
  std::map<int64_t, Sender> senders_ ABSL_GUARDED_BY(mutex_);  // By seat.
};

}  // namespace deform::server
