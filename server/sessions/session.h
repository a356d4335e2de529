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

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "core/base/thread_pool.h"
#include "core/deform/deformer.h"
#include "server/models/binding_registry.h"
#include "server/sessions/audience.h"
#include "server/sessions/batch_scheduler.h"
#include "server/sessions/frame.h"
#include "server/sessions/frame_maker.h"
#include "server/sessions/frame_tables.h"
#include "server/sessions/frame_wishes.h"
#include "server/sessions/outbox.h"
#include "server/sessions/participant.h"
#include "server/sessions/pose_queue.h"
#include "server/sessions/rig_change.h"
#include "server/sessions/rig_history.h"
#include "server/sessions/roster.h"
#include "server/sessions/session_journal.h"

namespace deform::server {

// Never goes back; tests pass their own.
using Clock = std::function<std::chrono::steady_clock::time_point()>;

class Session;

// What all sessions of a server share. Pointers are borrowed.
struct SessionEnvironment {
  BatchScheduler* scheduler = nullptr;  // Runs steps.
  Allowance* drags = &Unlimited();      // Of which fast drags take memory.
  Clock clock;
  int max_participants = 64;
  // How long a receiver may take to send one message.
  std::chrono::milliseconds stall_timeout{10000};
  // How long the place of a broken stream is kept.
  std::chrono::milliseconds resume_grace{60000};
  // Calls at that time or soon after, on any thread, never inside the call.
  // Used once a participant limits its frames.
  std::function<void(std::chrono::steady_clock::time_point,
                     std::function<void()>)>
      call_at = {};
  std::shared_ptr<FrameTables> frame_tables = std::make_shared<FrameTables>();
  JournalReport report = {};  // May be empty.
  // What the manager adds. The store of all sessions; null: they are not kept.
  Store* store = nullptr;
  // Has WakeUp() called soon, never inside the call.
  std::function<void(std::shared_ptr<Session>)> wake = {};
};

// A session as others see it.
struct SessionState {
  std::string tenant;
  std::string id;
  std::string binding_id;
  uint64_t revision = 0;
  // What of it is there after a restart; 0 if the server keeps nothing.
  uint64_t durable_revision = 0;
  uint64_t epoch = 0;
  int participants = 0;
  absl::Time create_time;
};

// As the store has it.
struct StoredStart {
  std::string id;
  SessionPose at;  // In the epoch of this server.
  absl::Time create_time;
};

// Poses merge into a queue of steps; a step is run by the scheduler, one at a
// time: the deformer moves, the revision rises, its frames are encoded, each
// once for all who receive the same bytes, and offered to every participant.
// The store is told of every revision, and nobody waits for it. Thread-safe;
// the lock is never held while deforming or encoding.
class Session : public std::enable_shared_from_this<Session> {
 public:
  // A participant's poses that may wait with Delivery::kEvery.
  static constexpr int64_t kMaxOwnSteps = 4;

  // Starts at the rest pose, revision 0, epoch 1. It is to be put into the
  // store before it is used.
  static std::shared_ptr<Session> Create(std::string id, BindingInUse binding,
                                         MemoryBudget::Reservation memory,
                                         const SessionEnvironment& environment);
  // Starts where it was, asleep: without weights, until somebody wants a frame
  // or sends a pose. DataLoss SESSION_DAMAGED if the pose is not of this rig.
  static absl::StatusOr<std::shared_ptr<Session>> Restore(
      StoredStart start, BindingCatalogue::Lease binding,
      MemoryBudget::Reservation memory, const SessionEnvironment& environment);

  const std::string& id() const { return id_; }
  // Raised by every server that takes the session over.
  uint64_t epoch() const { return journal_.epoch(); }
  // See SessionJournal. Takes no lock.
  uint64_t durable_revision() const { return journal_.durable_revision(); }
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
    FrameFormat format;
    SessionState state;
    BindingFacts binding;
    Pose pose;
    int64_t participant_id = 0;  // The same over all its streams.
    std::string token;           // To come back with.
    bool resumed = false;        // The token was known.
    uint64_t last_sequence = 0;  // Of what was accepted from it.
  };
  // A frame of the present state follows. Who comes back by a token goes on
  // where it was; a stream that still has its place ends Aborted TAKEN_OVER.
  // ResourceExhausted TOO_MANY_PARTICIPANTS; FailedPrecondition RIG_CHANGED
  // (too often since); what PickFormat() and Roster refuse; after End() or
  // Drain() their status.
  absl::StatusOr<Joined> Join(Delivery delivery, const FrameWishes& wishes,
                              std::weak_ptr<Receiver> receiver,
                              const Introduction& who = {});

  // Moves to the binding of edited handles, as a revision of its own, before
  // the poses that wait: these are taken over. Participants are told before the
  // first frame of it. The outcome goes to `move.done`.
  void Move(RigMove move);

  // If the weights of its binding have another form by now, changes over to it
  // before the next pose. That is no revision: who joins may see the present
  // one apart from others by the bound of compressed weights.
  void Refresh();

  // What a session asleep still needs, and who can get it: then it goes on. If
  // the weights cannot be had, the streams there are end with the reason, and
  // it sleeps on.
  using FindWeights =
      absl::FunctionRef<absl::StatusOr<std::shared_ptr<const Binding>>(
          const std::shared_ptr<const BindingRecord>&)>;
  void WakeUp(FindWeights find_weights);

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
    // Of the weights that the deformer has; null: see Session::basis_.
    std::shared_ptr<const NamedBasis> basis;
    std::string binding_id;        // Before it.
    std::vector<FrameKey> wanted;  // Frames to be made.
    bool wants_normals = false;
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

  // `binding` may be null in `use`.
  Session(StoredStart start, BindingInUse use, MemoryBudget::Reservation memory,
          const SessionEnvironment& environment);

  // Of the present binding, also while the session sleeps; until it has ended.
  const BindingFacts& facts() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return lease_.record()->facts;
  }
  SessionState StateLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The place that was taken, if there was one, and what has changed since.
  absl::StatusOr<Rejoining> Welcome(const Roster::Member& member,
                                    const Introduction& who) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Ends the stream in this seat; its member has left.
  void Dismiss(int64_t seat) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Changes of the rig since the member joined.
  uint64_t RigChangesFor(const Roster::Member& member) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The update as it is for the present rig.
  absl::StatusOr<PoseUpdate> CheckPose(const Roster::Member& member,
                                       uint64_t sequence,
                                       const absl::StatusOr<PoseUpdate>& update,
                                       const PoseTerms& terms) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // InvalidArgument RIG_CHANGED unless the member knows the present rig.
  absl::Status CheckIsOfRig(const Roster::Member& member,
                            uint64_t rig_changes) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // What moves the rig: `write` is its number in the roster.
  void Accept(Roster::Member& member, Outbox& outbox, uint64_t sequence,
              const PoseUpdate& update, uint64_t write)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool CanMove() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool CanStep() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Schedule() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Has the session called when the interval of a receiver that lacks a frame
  // is over.
  void CallWhenDue() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ServeWhoIsDue(Audience::TimePoint due) ABSL_LOCKS_EXCLUDED(mutex_);
  // What its stream took last, before it is sent.
  void Complete(Outgoing& outgoing) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static void Wake(const Receivers& receivers);

  // Makes the basis of the present weights, if it is wanted and not there:
  // takes time. Each step sees to that, for the next.
  void ProvideBasis() ABSL_LOCKS_EXCLUDED(mutex_);
  // The weights of the frames that come next.
  void SetWeights(std::shared_ptr<const Binding> weights,
                  std::shared_ptr<const NamedBasis> basis = nullptr)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  absl::Status ChangeRig(Step& step, ThreadPool* pool);
  void ChangeForm(Step& step, ThreadPool* pool);
  void Describe(const Pose& pose, const DeformReport& report,
                std::chrono::microseconds time);
  Receivers Publish(Step& step, Frames frames,
                    std::shared_ptr<const FrameNormals> normals);
  void PublishChange(Step& step) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Tells the store of the revision that `before` went to.
  void Journal(const Step& step, const Pose& before)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // If it has become another server's.
  void EndIfLost();

  const std::string id_;
  const std::string tenant_;
  const int dimension_;
  const absl::Time create_time_;
  const SessionEnvironment environment_;

  // Used by the running step only, or by who wakes the session up; the queue of
  // the scheduler hands them from one to the next.
  std::unique_ptr<Deformer> deformer_;
  FrameInfo info_;
  FrameMaker frame_maker_;

  mutable Mutex mutex_;
  MemoryBudget::Reservation memory_ ABSL_GUARDED_BY(mutex_);
  BindingCatalogue::Lease lease_ ABSL_GUARDED_BY(mutex_);
  std::string binding_id_ ABSL_GUARDED_BY(mutex_);
  // Null while it is asleep.
  std::shared_ptr<const Binding> weights_ ABSL_GUARDED_BY(mutex_);
  bool waking_ ABSL_GUARDED_BY(mutex_) = false;
  // Of the weights; null: they are dense, nobody has wanted it, or not yet.
  std::shared_ptr<const NamedBasis> basis_ ABSL_GUARDED_BY(mutex_);
  // Somebody has joined who takes frames of it.
  bool wants_basis_ ABSL_GUARDED_BY(mutex_) = false;
  // The same weights in another form, to be changed over to.
  std::shared_ptr<const Binding> refreshed_ ABSL_GUARDED_BY(mutex_);
  std::deque<RigMove> moves_ ABSL_GUARDED_BY(mutex_);
  RigHistory rig_history_ ABSL_GUARDED_BY(mutex_);
  PoseQueue queue_ ABSL_GUARDED_BY(mutex_);
  bool scheduled_ ABSL_GUARDED_BY(mutex_) = false;
  // When CallWhenDue() will have it called next.
  std::optional<Audience::TimePoint> called_at_ ABSL_GUARDED_BY(mutex_);
  uint64_t revision_ ABSL_GUARDED_BY(mutex_) = 0;
  Pose pose_ ABSL_GUARDED_BY(mutex_);  // Of the revision.
  std::optional<absl::Status> closed_ ABSL_GUARDED_BY(mutex_);
  Audience audience_ ABSL_GUARDED_BY(mutex_);
  // Appends are made with the lock held; none waits for a disk.
  SessionJournal journal_;
  // Set if the session has become another server's.
  std::optional<absl::Status> lost_ ABSL_GUARDED_BY(mutex_);
  Roster roster_ ABSL_GUARDED_BY(mutex_);
  // Seats whose streams are to end, with the reason.
  std::map<int64_t, absl::Status> dismissed_ ABSL_GUARDED_BY(mutex_);
};

// NotFound SESSION_DELETED.
absl::Status SessionDeleted(const std::string& id);

}  // namespace deform::server
