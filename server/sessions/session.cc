#include "server/sessions/session.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/names.h"

namespace deform::server {
namespace {

// The origin of frames follows the rig in steps of this, in units of D: float
// positions relative to it then keep seven digits of the model's size, and most
// frames need no new origin.
constexpr double kOriginStep = 0.25;

// The largest distance between the deformed points of two deformers of a model.
double LargestJump(const Deformer& from, const Deformer& to) {
  return (to.positions() - from.positions()).rowwise().norm().maxCoeff();
}

}  // namespace

std::shared_ptr<Session> Session::Create(
    std::string id, BindingInUse binding, MemoryBudget::Reservation memory,
    const SessionEnvironment& environment) {
  return std::shared_ptr<Session>(new Session(std::move(id), std::move(binding),
                                              std::move(memory), environment));
}

Session::Session(std::string id, BindingInUse binding,
                 MemoryBudget::Reservation memory,
                 const SessionEnvironment& environment)
    : id_(std::move(id)),
      tenant_(binding.lease.record()->tenant),
      dimension_(binding.binding->dimension()),
      create_time_(absl::Now()),
      environment_(environment),
      deformer_(std::make_unique<Deformer>(binding.binding, nullptr)),
      memory_(std::move(memory)),
      lease_(std::move(binding.lease)),
      binding_id_(lease_.record()->id),
      binding_(std::move(binding.binding)),
      queue_(RestPose(binding_->rig())),
      pose_(RestPose(binding_->rig())) {
  info_.origin = BoxOf(pose_.vertices).center();
  info_.origin_number = 1;
}

int64_t Session::BytesFor(const BindingFacts& binding) {
  const int64_t columns = binding.column_count();
  // Displacements of double, two frames of float, columns and a few poses.
  return binding.point_count() * 3 *
             int64_t{sizeof(double) + 2 * sizeof(float)} +
         6 * columns * 3 * int64_t{sizeof(double)};
}

SessionState Session::state() const {
  MutexLock lock(mutex_);
  return StateLocked();
}

Session::Posed Session::posed() const {
  MutexLock lock(mutex_);
  return {binding_id_, pose_};
}

SessionState Session::StateLocked() const {
  return {.tenant = tenant_,
          .id = id_,
          .binding_id = binding_id_,
          .revision = revision_,
          .epoch = epoch(),
          .participants = static_cast<int>(seats_.size()),
          .create_time = create_time_};
}

absl::StatusOr<Session::Joined> Session::Join(
    Delivery delivery, const FrameEncoding& encoding,
    std::weak_ptr<Receiver> receiver) {
  MutexLock lock(mutex_);
  if (closed_) return *closed_;
  if (static_cast<int>(seats_.size()) >= environment_.max_participants) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat("the session has ", seats_.size(),
                     " participants, its limit (max-participants)"),
        {.reason = "TOO_MANY_PARTICIPANTS", .field = "max-participants"});
  }
  Seat seat{.outbox = Outbox(delivery),
            .encoding = &encoding,
            .receiver = std::move(receiver),
            .first_change = change_count_};
  const auto frame = frames_.find(&encoding);
  if (frame != frames_.end()) {
    seat.outbox.Offer(frame->second, 0);
  } else {
    seat.needs_frame = true;
  }
  const int64_t number = next_seat_++;
  seats_.emplace(number, std::move(seat));
  Schedule();
  return Joined{
      std::unique_ptr<Participant>(new Participant(shared_from_this(), number)),
      StateLocked(), binding_, pose_};
}

void Session::Move(RigMove move) {
  absl::Status closed;
  {
    MutexLock lock(mutex_);
    if (!closed_) {
      moves_.push_back(std::move(move));
      Schedule();
      return;
    }
    closed = *closed_;
  }
  move.done(closed);
}

void Session::Refresh() {
  MutexLock lock(mutex_);
  if (closed_) return;
  auto now = lease_.record()->weights->Get();
  if (now == nullptr || now == binding_) return;
  refreshed_ = std::move(now);
  Schedule();
}

void Session::End(const absl::Status& status) {
  Receivers receivers;
  std::deque<RigMove> moves;
  {
    MutexLock lock(mutex_);
    closed_ = status;
    lease_ = {};
    queue_.Clear();
    moves.swap(moves_);
    for (auto& [number, seat] : seats_) seat.outbox.EndNow(status);
    receivers = ReceiversLocked();
  }
  for (const RigMove& move : moves) move.done(status);
  for (const auto& weak : receivers) {
    if (const auto receiver = weak.lock()) receiver->Wake();
  }
}

void Session::Drain(const absl::Status& status) {
  Receivers receivers;
  {
    MutexLock lock(mutex_);
    if (!closed_) closed_ = status;
    for (auto& [number, seat] : seats_) seat.outbox.EndWhenAnswered(status);
    receivers = ReceiversLocked();
  }
  for (const auto& weak : receivers) {
    if (const auto receiver = weak.lock()) receiver->Wake();
  }
}

Session::Receivers Session::ReceiversLocked() const {
  Receivers receivers;
  for (const auto& [number, seat] : seats_) receivers.push_back(seat.receiver);
  return receivers;
}

bool Session::CanStep() const {
  return !queue_.empty() &&
         std::none_of(seats_.begin(), seats_.end(), [](const auto& seat) {
           return seat.second.outbox.full();
         });
}

bool Session::CanMove() const {
  return !moves_.empty() &&
         std::none_of(seats_.begin(), seats_.end(), [](const auto& seat) {
           const Outbox& outbox = seat.second.outbox;
           return outbox.full() || !outbox.has_room_for_rig_changes();
         });
}

bool Session::NeedsFrame() const {
  return std::any_of(seats_.begin(), seats_.end(),
                     [](const auto& seat) { return seat.second.needs_frame; });
}

void Session::Schedule() {
  if (scheduled_ ||
      !(CanStep() || CanMove() || NeedsFrame() || refreshed_ != nullptr)) {
    return;
  }
  scheduled_ = true;
  environment_.scheduler->Add(shared_from_this(), *binding_);
}

Session::Step Session::BeginStep() {
  Step step{.deformer = deformer_.get()};
  MutexLock lock(mutex_);
  step.binding_id = binding_id_;
  // Who has joined sees the state as it was before anything newer.
  if (!NeedsFrame()) {
    if (refreshed_ != nullptr) {
      step.refreshed = std::move(refreshed_);
    } else if (CanMove()) {
      step.move = std::move(moves_.front());
      moves_.pop_front();
    } else if (CanStep()) {
      step.pose = queue_.Pop();
    }
  }
  for (const auto& [number, seat] : seats_) {
    if ((step.move || step.pose || seat.needs_frame) &&
        std::find(step.encodings.begin(), step.encodings.end(),
                  seat.encoding) == step.encodings.end()) {
      step.encodings.push_back(seat.encoding);
    }
  }
  return step;
}

void Session::FinishStep(Step step, ThreadPool* pool) {
  absl::Status moved;
  if (step.move) moved = ChangeRig(step, pool);
  if (step.refreshed != nullptr) ChangeForm(step, pool);
  if (step.pose) Describe(step.pose->pose, step.report, step.deform_time);
  Frames frames;
  for (const FrameEncoding* encoding : step.encodings) {
    frames[encoding] = EncodeFrame(*deformer_, *encoding, info_, pool);
  }
  for (const auto& weak : Publish(step, std::move(frames))) {
    if (const auto receiver = weak.lock()) receiver->Wake();
  }
  if (!step.move) return;
  // The binding before is let go before anyone learns of it.
  const auto done = std::move(step.move->done);
  step.move.reset();
  Refresh();
  if (step.change != nullptr) {
    done(RigMoved{step.change->revision, step.change->largest_jump});
  } else {
    done(moved);
  }
}

void Session::Describe(const Pose& pose, const DeformReport& report,
                       std::chrono::microseconds time) {
  info_.deform_time = time;
  info_.columns_applied = report.columns_applied;
  info_.exit_mismatch = report.exit_mismatch;
  ++info_.revision;
  const Vec3 center = BoxOf(pose.vertices).center();
  const double far = kOriginStep * DiagonalOf(deformer_->binding().rig());
  if (!((center - info_.origin).norm() <= far)) {
    info_.origin = center;
    ++info_.origin_number;
  }
}

absl::Status Session::ChangeRig(Step& step, ThreadPool* pool) {
  const RigMove& move = *step.move;
  if (move.from != step.binding_id) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     absl::StrCat("session ", Quoted(id_), " has binding ",
                                  Quoted(step.binding_id), " by now, not ",
                                  Quoted(move.from)),
                     {.reason = "OTHER_BINDING",
                      .resource_type = "session",
                      .resource_name = id_});
  }
  DEFORM_ASSIGN_OR_RETURN(
      PoseTransfer transfer,
      PoseTransfer::Create(deformer_->binding(), *move.to.binding,
                           move.previous, deformer_->pose()));
  const auto begin = std::chrono::steady_clock::now();
  auto next = std::make_unique<Deformer>(move.to.binding, nullptr);
  DeformJob job{.deformer = next.get(), .pose = &transfer.pose()};
  MoveTogether({&job, 1}, pool);
  const auto before = std::exchange(deformer_, std::move(next));
  Describe(transfer.pose(), job.report,
           std::chrono::duration_cast<std::chrono::microseconds>(
               std::chrono::steady_clock::now() - begin));
  const double jump =
      LargestJump(*before, *deformer_) / DiagonalOf(deformer_->binding().rig());
  step.change = std::make_shared<const RigChange>(
      RigChange{.binding_id = move.to.lease.record()->id,
                .dimension = dimension_,
                .transfer = std::move(transfer),
                .revision = info_.revision,
                .largest_jump = jump});
  return absl::OkStatus();
}

void Session::ChangeForm(Step& step, ThreadPool* pool) {
  const Pose pose = deformer_->pose();
  auto next = std::make_unique<Deformer>(step.refreshed, nullptr);
  DeformJob job{.deformer = next.get(), .pose = &pose};
  MoveTogether({&job, 1}, pool);
  deformer_ = std::move(next);
  // The former weights go with the step, not under the lock.
  MutexLock lock(mutex_);
  binding_.swap(step.refreshed);
}

Session::Receivers Session::Publish(Step& step, Frames frames) {
  MutexLock lock(mutex_);
  if (step.change != nullptr) PublishChange(step);
  if (step.pose) {
    pose_ = step.pose->pose;
    for (const PoseQueue::Answer& answer : step.pose->answers) {
      const auto seat = seats_.find(answer.participant);
      if (seat != seats_.end()) seat->second.contained = answer.sequence;
    }
  }
  const bool newer = revision_ != info_.revision;
  if (newer) frames_.clear();
  revision_ = info_.revision;
  frames_.merge(frames);
  for (auto& [number, seat] : seats_) {
    if (!newer && !seat.needs_frame) continue;
    const auto frame = frames_.find(seat.encoding);
    // Who joined during the step may want an encoding that was not in use.
    seat.needs_frame = frame == frames_.end();
    if (!seat.needs_frame) seat.outbox.Offer(frame->second, seat.contained);
  }
  scheduled_ = false;
  Schedule();
  return ReceiversLocked();
}

void Session::PublishChange(Step& step) {
  refreshed_.reset();  // Of the binding before.
  pose_ = step.change->transfer.pose();
  queue_.Transfer(step.change->transfer);
  if (!closed_) lease_ = std::move(step.move->to.lease);
  memory_ = std::move(step.move->memory);
  binding_id_ = step.change->binding_id;
  binding_ = std::move(step.move->to.binding);
  changes_.push_back(step.change);
  ++change_count_;
  if (changes_.size() > kMaxRigChanges) changes_.pop_front();
  for (auto& [number, seat] : seats_) seat.outbox.Announce(step.change);
}

Participant::~Participant() { Leave(); }

bool Participant::Submit(uint64_t sequence,
                         const absl::StatusOr<PoseUpdate>& update,
                         uint64_t rig_changes) {
  Session& session = *session_;
  MutexLock lock(session.mutex_);
  const auto found = session.seats_.find(seat_);
  if (found == session.seats_.end() || session.closed_) return false;
  Session::Seat& seat = found->second;
  const absl::StatusOr<PoseUpdate> checked =
      session.CheckPose(seat, sequence, update, rig_changes);
  if (!checked.ok()) {
    seat.outbox.Reject(sequence, checked.status());
    return false;
  }
  seat.last_sequence = sequence;
  seat.outbox.Expect(sequence);
  session.queue_.Push({.participant = seat_, .sequence = sequence}, *checked,
                      seat.outbox.delivery() == Delivery::kEvery);
  session.Schedule();
  return true;
}

absl::StatusOr<PoseUpdate> Session::CheckPose(
    const Seat& seat, uint64_t sequence,
    const absl::StatusOr<PoseUpdate>& update, uint64_t rig_changes) const {
  if (sequence <= seat.last_sequence) {
    return InvalidInput(
        "SEQUENCE_NOT_RISING", "pose.sequence",
        absl::StrCat("pose ", sequence, " comes after pose ",
                     seat.last_sequence, "; sequences rise from 1"));
  }
  if (!update.ok()) return update.status();
  const uint64_t changes = change_count_ - seat.first_change;
  if (rig_changes > changes) {
    return InvalidInput(
        "RIG_UNKNOWN", "pose.rig_changes",
        absl::StrCat("pose.rig_changes is ", rig_changes,
                     ", but this stream was told of ", changes));
  }
  if (rig_changes < changes) return TakeOver(*update, changes - rig_changes);
  DEFORM_RETURN_IF_ERROR(CheckPoseUpdate(*update, binding_->rig()));
  return *update;
}

absl::StatusOr<PoseUpdate> Session::TakeOver(PoseUpdate update,
                                             uint64_t changes) const {
  if (changes > changes_.size()) {
    return InvalidInput(
        "RIG_CHANGED", "pose.rig_changes",
        absl::StrCat("the rig has changed ", changes,
                     " times since the one that this pose is for: read "
                     "rig_changed"));
  }
  for (auto change = changes_.end() - static_cast<int64_t>(changes);
       change != changes_.end(); ++change) {
    const PoseTransfer& transfer = (*change)->transfer;
    const absl::Status status = CheckPoseUpdate(update, transfer.from());
    if (!status.ok()) {
      return Annotate(status,
                      absl::StrCat("the rig has changed, and this pose is not "
                                   "for the new one (rig_changes): "));
    }
    DEFORM_ASSIGN_OR_RETURN(update, transfer.Transfer(update));
  }
  return update;
}

bool Participant::WantsPoses() const {
  MutexLock lock(session_->mutex_);
  const auto found = session_->seats_.find(seat_);
  if (found == session_->seats_.end() || session_->closed_) return false;
  const Outbox& outbox = found->second.outbox;
  return outbox.has_room_for_rejections() &&
         (outbox.delivery() != Delivery::kEvery ||
          session_->queue_.OwnStepsOf(seat_) < Session::kMaxOwnSteps);
}

void Participant::HalfClose() {
  MutexLock lock(session_->mutex_);
  const auto found = session_->seats_.find(seat_);
  if (found == session_->seats_.end()) return;
  found->second.outbox.EndWhenAnswered(absl::OkStatus());
}

std::optional<Outgoing> Participant::Take() {
  MutexLock lock(session_->mutex_);
  const auto found = session_->seats_.find(seat_);
  if (found == session_->seats_.end()) return std::nullopt;
  Session::Seat& seat = found->second;
  std::optional<Outgoing> next = seat.outbox.Take();
  seat.sending_since.reset();
  if (next) seat.sending_since = session_->environment_.clock();
  session_->Schedule();
  return next;
}

void Participant::Progressed() {
  MutexLock lock(session_->mutex_);
  const auto found = session_->seats_.find(seat_);
  if (found == session_->seats_.end()) return;
  found->second.sending_since = session_->environment_.clock();
}

absl::Status Participant::CheckStall() const {
  const SessionEnvironment& environment = session_->environment_;
  const auto now = environment.clock();
  MutexLock lock(session_->mutex_);
  const auto found = session_->seats_.find(seat_);
  if (found == session_->seats_.end()) return absl::OkStatus();
  const auto& since = found->second.sending_since;
  if (!since || now - *since <= environment.stall_timeout) {
    return absl::OkStatus();
  }
  return MakeError(
      absl::StatusCode::kAborted,
      absl::StrCat("the stream took no message for ",
                   environment.stall_timeout.count() / 1000.0,
                   " s (stall-timeout): read faster, or join again"),
      {.reason = "RECEIVER_STALLED", .field = "stall-timeout"});
}

void Participant::Leave() {
  MutexLock lock(session_->mutex_);
  session_->seats_.erase(seat_);
  session_->Schedule();
}

}  // namespace deform::server
