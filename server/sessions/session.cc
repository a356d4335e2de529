#include "server/sessions/session.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"

namespace deform::server {
namespace {

// The origin of frames follows the rig in steps of this, in units of D: float
// positions relative to it then keep seven digits of the model's size, and most
// frames need no new origin.
constexpr double kOriginStep = 0.25;

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
      binding_id_(binding.lease.record()->id),
      create_time_(absl::Now()),
      environment_(environment),
      memory_(std::move(memory)),
      deformer_(std::move(binding.binding), nullptr),
      lease_(std::move(binding.lease)),
      queue_(RestPose(deformer_.binding().rig())),
      pose_(RestPose(deformer_.binding().rig())) {
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
            .receiver = std::move(receiver)};
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
      StateLocked(), pose_};
}

void Session::End(const absl::Status& status) {
  Receivers receivers;
  {
    MutexLock lock(mutex_);
    closed_ = status;
    lease_ = {};
    queue_.Clear();
    for (auto& [number, seat] : seats_) seat.outbox.EndNow(status);
    receivers = ReceiversLocked();
  }
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

bool Session::NeedsFrame() const {
  return std::any_of(seats_.begin(), seats_.end(),
                     [](const auto& seat) { return seat.second.needs_frame; });
}

void Session::Schedule() {
  if (scheduled_ || !(CanStep() || NeedsFrame())) return;
  scheduled_ = true;
  environment_.scheduler->Add(shared_from_this(), deformer_.binding());
}

Session::Step Session::BeginStep() {
  Step step{.deformer = &deformer_};
  MutexLock lock(mutex_);
  // Who has joined sees the state as it was before anything newer.
  if (CanStep() && !NeedsFrame()) step.pose = queue_.Pop();
  for (const auto& [number, seat] : seats_) {
    if ((step.pose || seat.needs_frame) &&
        std::find(step.encodings.begin(), step.encodings.end(),
                  seat.encoding) == step.encodings.end()) {
      step.encodings.push_back(seat.encoding);
    }
  }
  return step;
}

void Session::FinishStep(Step step, ThreadPool* pool) {
  if (step.pose) Describe(step);
  Frames frames;
  for (const FrameEncoding* encoding : step.encodings) {
    frames[encoding] = EncodeFrame(deformer_, *encoding, info_, pool);
  }
  for (const auto& weak : Publish(step.pose, std::move(frames))) {
    if (const auto receiver = weak.lock()) receiver->Wake();
  }
}

void Session::Describe(const Step& step) {
  info_.deform_time = step.deform_time;
  info_.columns_applied = step.report.columns_applied;
  info_.exit_mismatch = step.report.exit_mismatch;
  ++info_.revision;
  const Vec3 center = BoxOf(step.pose->pose.vertices).center();
  const double far = kOriginStep * DiagonalOf(deformer_.binding().rig());
  if (!((center - info_.origin).norm() <= far)) {
    info_.origin = center;
    ++info_.origin_number;
  }
}

Session::Receivers Session::Publish(const std::optional<PoseQueue::Step>& step,
                                    Frames frames) {
  MutexLock lock(mutex_);
  if (step) {
    revision_ = info_.revision;
    pose_ = step->pose;
    frames_.clear();
    for (const PoseQueue::Answer& answer : step->answers) {
      const auto seat = seats_.find(answer.participant);
      if (seat != seats_.end()) seat->second.contained = answer.sequence;
    }
  }
  frames_.merge(frames);
  for (auto& [number, seat] : seats_) {
    if (!step && !seat.needs_frame) continue;
    const auto frame = frames_.find(seat.encoding);
    // Who joined during the step may want an encoding that was not in use.
    seat.needs_frame = frame == frames_.end();
    if (!seat.needs_frame) seat.outbox.Offer(frame->second, seat.contained);
  }
  scheduled_ = false;
  Schedule();
  return ReceiversLocked();
}

Participant::~Participant() { Leave(); }

void Participant::Submit(uint64_t sequence,
                         const absl::StatusOr<PoseUpdate>& update) {
  Session& session = *session_;
  MutexLock lock(session.mutex_);
  const auto found = session.seats_.find(seat_);
  if (found == session.seats_.end() || session.closed_) return;
  Session::Seat& seat = found->second;
  const absl::Status status = session.CheckPose(seat, sequence, update);
  if (!status.ok()) {
    seat.outbox.Reject(sequence, status);
    return;
  }
  seat.last_sequence = sequence;
  seat.outbox.Expect(sequence);
  session.queue_.Push({.participant = seat_, .sequence = sequence}, *update,
                      seat.outbox.delivery() == Delivery::kEvery);
  session.Schedule();
}

absl::Status Session::CheckPose(
    const Seat& seat, uint64_t sequence,
    const absl::StatusOr<PoseUpdate>& update) const {
  if (sequence <= seat.last_sequence) {
    return InvalidInput(
        "SEQUENCE_NOT_RISING", "pose.sequence",
        absl::StrCat("pose ", sequence, " comes after pose ",
                     seat.last_sequence, "; sequences rise from 1"));
  }
  if (!update.ok()) return update.status();
  return CheckPoseUpdate(*update, binding().rig());
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
