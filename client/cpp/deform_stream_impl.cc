#include "client/cpp/deform_stream_impl.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cpp/status.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

absl::Status Cancelled() {
  return absl::CancelledError("the stream was cancelled");
}

void SetSequence(uint64_t sequence, v1::DeformRequest& request) {
  if (request.has_pose()) request.mutable_pose()->set_sequence(sequence);
  if (request.has_lock()) request.mutable_lock()->set_sequence(sequence);
  if (request.has_unlock()) request.mutable_unlock()->set_sequence(sequence);
  if (request.has_undo()) request.mutable_undo()->set_sequence(sequence);
  if (request.has_redo()) request.mutable_redo()->set_sequence(sequence);
}

}  // namespace

DeformStream::Impl::Impl(std::shared_ptr<v1::SessionService::Stub> stub,
                         v1::Join join, const DeformOptions& options)
    : stub_(std::move(stub)),
      options_(options),
      join_(std::move(join)),
      weights_(options.pool),
      backoff_(
          options.reconnect_for,
          [] { return std::chrono::steady_clock::now(); },
          std::random_device()()) {}

DeformStream::Impl::~Impl() {
  Cancel();
  std::thread resender;
  {
    MutexLock lock(mutex_);
    resender.swap(resender_);
  }
  if (resender.joinable()) resender.join();
}

absl::Status DeformStream::Impl::Join() {
  auto link = std::make_shared<DeformLink>(*stub_);
  DEFORM_ASSIGN_OR_RETURN(const v1::Joined joined, link->Join(join_));
  DEFORM_ASSIGN_OR_RETURN(joined_, FromProto(joined));
  if (options_.weights.binding != nullptr) {
    DEFORM_RETURN_IF_ERROR(HeldWeights::Check(options_.weights, joined_));
    weights_.Add(options_.weights, binding_id());
  }
  if (options_.basis.basis != nullptr) {
    DEFORM_RETURN_IF_ERROR(HeldWeights::Check(options_.basis, joined_));
    weights_.Add(options_.basis);
  }
  return Adopt(std::move(link), joined);
}

absl::StatusOr<uint64_t> DeformStream::Impl::Send(const PoseUpdate& update,
                                                  const PoseOptions& options) {
  v1::DeformRequest request;
  *request.mutable_pose() =
      ToProto(update, joined_.dimension, 0,
              options.rig_changes ? *options.rig_changes : told_changes());
  request.mutable_pose()->set_edit(options.edit);
  if (options.base_revision) {
    request.mutable_pose()->set_base_revision(*options.base_revision);
  }
  return Ask(std::move(request));
}

absl::StatusOr<uint64_t> DeformStream::Impl::Ask(v1::DeformRequest request) {
  SetSequence(sequence_ + 1, request);
  DEFORM_RETURN_IF_ERROR(Queue(sequence_ + 1, std::move(request)));
  return ++sequence_;
}

absl::Status DeformStream::Impl::Tell(v1::DeformRequest request) {
  return Queue(0, std::move(request));
}

absl::Status DeformStream::Impl::Queue(uint64_t sequence,
                                       v1::DeformRequest request) {
  MutexLock lock(mutex_);
  if (closing_) {
    return absl::FailedPreconditionError("no pose can follow Close()");
  }
  const auto ended = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return over_ || cancelled_ ||
           (broken_ && options_.reconnect_for.count() == 0);
  };
  if (!ended()) {
    if (!Unanswered::CountRigChangesFrom(change_base_, request)) {
      return InvalidInput("RIG_CHANGED", "rig_changes",
                          "this is meant for a rig before the stream joined "
                          "anew: read rig_changes()");
    }
    if (request.has_presence()) shown_ = request;
    DEFORM_RETURN_IF_ERROR(unanswered_.Add(sequence, std::move(request)));
    Drain();
  }
  if (!ended()) return absl::OkStatus();
  return absl::UnavailableError(
      "the stream has ended; receiving tells the reason");
}

void DeformStream::Impl::Drain() {
  if (draining_) return;
  draining_ = true;
  DrainAsTheOne();
}

void DeformStream::Impl::DrainAsTheOne() {
  while (!broken_ && !cancelled_) {
    const std::shared_ptr<DeformLink> link = link_;
    const Unanswered::Request request = unanswered_.TakeUnsent();
    const bool close = request == nullptr && closing_ && !writes_done_;
    if (request == nullptr && !close) break;
    // gRPC ends the program if a stream is closed twice, or written to after.
    if (close) writes_done_ = true;
    mutex_.Unlock();
    bool sent = true;
    if (close) {
      link->WritesDone();
    } else {
      sent = link->Write(*request);
    }
    mutex_.Lock();
    // Or there is another connection by now.
    if (!sent && link == link_) broken_ = true;
  }
  draining_ = false;
}

void DeformStream::Impl::Close() {
  MutexLock lock(mutex_);
  closing_ = true;
  Drain();
}

void DeformStream::Impl::Cancel() {
  MutexLock lock(mutex_);
  cancelled_ = true;
  if (link_ != nullptr) link_->Cancel();
  cancelled_changed_.NotifyAll();
}

absl::Status DeformStream::Impl::Reconnect(absl::Status reason) {
  while (true) {
    {
      MutexLock lock(mutex_);
      if (cancelled_) return Cancelled();
      broken_ = true;
    }
    if (!IsResumable(reason) || options_.reconnect_for.count() == 0) {
      return reason;
    }
    const auto delay = backoff_.Next();
    if (!delay) {
      return MakeError(
          absl::StatusCode::kUnavailable,
          absl::StrCat("the stream broke, and could not be joined again for ",
                       options_.reconnect_for.count() / 1000.0,
                       " s: ", reason.message()),
          {.reason = "RECONNECT_TIMEOUT"});
    }
    if (!Sleep(*delay)) return Cancelled();
    reason = TryToReconnect();
    if (reason.ok()) return reason;
  }
}

absl::Status DeformStream::Impl::TryToReconnect() {
  auto link = std::make_shared<DeformLink>(*stub_);
  {
    MutexLock lock(mutex_);
    if (cancelled_) return Cancelled();
    link_ = link;  // To be cancelled, too.
    v1::Resume& resume = *join_.mutable_resume();
    if (last_revision_) resume.set_last_revision(*last_revision_);
    resume.set_last_sequence(unanswered_.answered_up_to());
    resume.set_rig_changes(rig_changes_.size() - change_base_);
    resume.set_attempt(resume.attempt() + 1);
  }
  reader_ = nullptr;
  DEFORM_ASSIGN_OR_RETURN(const v1::Joined joined, link->Join(join_));
  DEFORM_ASSIGN_OR_RETURN(const JoinedSession now, FromProto(joined));
  if (now.dimension != joined_.dimension ||
      now.point_count != joined_.point_count) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     "the session has another model than before",
                     {.reason = "OTHER_MODEL"});
  }
  const bool kept = joined.resumed() && joined.session().epoch() == epoch_;
  if (!kept && now.binding_id != binding_id()) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     "the rig has changed while the stream was broken, and its "
                     "place was not kept: join anew",
                     {.reason = "RIG_CHANGED"});
  }
  ++reconnections_;
  return Adopt(std::move(link), joined);
}

absl::Status DeformStream::Impl::Adopt(std::shared_ptr<DeformLink> link,
                                       const v1::Joined& joined) {
  reader_ = link;
  assembler_.emplace(joined_.dimension, joined_.point_count, options_.normals,
                     &weights_);
  assembler_->BeginBinding(binding_id());
  may_repeat_ = last_revision_.has_value();
  join_.mutable_resume()->set_token(joined.resume_token());
  known_.clear();
  const bool restarted = joined.session().epoch() != epoch_;
  const bool kept = joined.resumed() && !restarted;
  epoch_ = joined.session().epoch();
  MutexLock lock(mutex_);
  if (cancelled_) link->Cancel();
  link_ = std::move(link);
  broken_ = false;
  writes_done_ = false;
  unanswered_.Rejoined(joined.last_sequence(), restarted);
  // A server that has taken the session over knows of no change before.
  if (!kept) {
    const uint64_t changes = rig_changes_.size() - change_base_;
    if (!unanswered_.CountRigChangesFrom(changes)) {
      return MakeError(absl::StatusCode::kFailedPrecondition,
                       "poses for a rig of before cannot be sent again, since "
                       "the place of this stream was not kept: join anew",
                       {.reason = "RIG_CHANGED"});
    }
    change_base_ = rig_changes_.size();
  }
  // A limit is no reason not to go on.
  if (shown_) unanswered_.Add(0, *shown_).IgnoreError();
  if (draining_ || !(unanswered_.has_unsent() || closing_)) {
    return absl::OkStatus();
  }
  // Nobody else is at the queue, and this thread is to read.
  draining_ = true;
  if (resender_.joinable()) resender_.join();
  resender_ = std::thread([this] {
    MutexLock own_lock(mutex_);
    DrainAsTheOne();
  });
  return absl::OkStatus();
}

const std::string& DeformStream::Impl::binding_id() const {
  return rig_changes_.empty() ? joined_.binding_id
                              : rig_changes_.back().binding_id;
}

absl::Status DeformStream::Impl::Hold(const HeldBinding& weights) {
  DEFORM_RETURN_IF_ERROR(HeldWeights::Check(weights, joined_));
  weights_.Add(weights, binding_id());
  join_.mutable_held()->set_binding_id(weights.binding_id);
  return TellHeld();
}

absl::Status DeformStream::Impl::Hold(const HeldBasis& basis) {
  DEFORM_RETURN_IF_ERROR(HeldWeights::Check(basis, joined_));
  weights_.Add(basis);
  join_.mutable_held()->set_basis_id(basis.basis_id);
  return TellHeld();
}

absl::Status DeformStream::Impl::TellHeld() {
  v1::DeformRequest request;
  *request.mutable_held() = join_.held();
  return Tell(std::move(request));
}

bool DeformStream::Impl::Sleep(std::chrono::milliseconds time) {
  const auto end = std::chrono::steady_clock::now() + time;
  MutexLock lock(mutex_);
  while (!cancelled_) {
    const auto left = end - std::chrono::steady_clock::now();
    if (left.count() <= 0) return true;
    cancelled_changed_.WaitFor(mutex_, left);
  }
  return false;
}

absl::Status DeformStream::Impl::NextFrame(Frame& frame) {
  while (!ended_) {
    if (reader_->Read(response_)) {
      if (const auto result = Handle(frame)) return *result;
      continue;
    }
    absl::Status status = reader_->Finish();
    if (!status.ok())
      status = Reconnect(status);
    else
      status = absl::OutOfRangeError("the stream was closed");
    if (!status.ok()) return End(status);
  }
  return end_;
}

std::optional<absl::Status> DeformStream::Impl::Handle(Frame& frame) {
  switch (response_.message_case()) {
    case v1::DeformResponse::kFrame:
      return HandleFrame(frame);
    case v1::DeformResponse::kRigChanged: {
      absl::StatusOr<RigChange> change =
          FromProto(response_.rig_changed(), joined_.dimension);
      if (!change.ok()) return Refuse(change.status());
      rig_changes_.push_back(*std::move(change));
      assembler_->BeginBinding(binding_id());
      return std::nullopt;
    }
    case v1::DeformResponse::kPointOrder: {
      const absl::Status status = assembler_->AddOrder(response_.point_order());
      if (!status.ok()) return Refuse(status);
      return std::nullopt;
    }
    case v1::DeformResponse::kRejected:
      return HandleRejection();
    case v1::DeformResponse::kAcknowledged: {
      const v1::Acknowledged& done = response_.acknowledged();
      {
        MutexLock lock(mutex_);
        if (!unanswered_.Answered(done.sequence())) return std::nullopt;
      }
      if (options_.on_acknowledged) options_.on_acknowledged(FromProto(done));
      return std::nullopt;
    }
    case v1::DeformResponse::kParticipants:
      HandleParticipants();
      return std::nullopt;
    default:  // Messages of a later version of the protocol.
      return std::nullopt;
  }
}

std::optional<absl::Status> DeformStream::Impl::HandleFrame(Frame& frame) {
  const absl::StatusOr<bool> complete =
      assembler_->Add(response_.frame(), frame);
  if (!complete.ok()) return Refuse(complete.status());
  if (!*complete) return std::nullopt;
  backoff_.Succeeded();
  // Who was forgotten by the server is told of nothing before.
  if (frame.epoch == last_epoch_) {
    frame.answers_sequence = std::max(frame.answers_sequence, last_answered_);
  }
  {
    MutexLock lock(mutex_);
    unanswered_.AnsweredUpTo(frame.answers_sequence, frame.revision);
    unanswered_.DurableUpTo(frame.durable_revision);
  }
  const bool repeats = std::exchange(may_repeat_, false) &&
                       frame.epoch == last_epoch_ &&
                       frame.revision == last_revision_ &&
                       frame.answers_sequence == last_answered_;
  last_epoch_ = frame.epoch;
  last_revision_ = frame.revision;
  last_answered_ = frame.answers_sequence;
  told_changes_ = rig_changes_.size();
  if (repeats) return std::nullopt;
  return absl::OkStatus();
}

std::optional<absl::Status> DeformStream::Impl::HandleRejection() {
  const v1::PoseRejected& rejected = response_.rejected();
  {
    MutexLock lock(mutex_);
    // What was told on the connection before may come again.
    const bool waited_for = unanswered_.Answered(rejected.sequence());
    if (!waited_for && reconnections_ > 0 && rejected.sequence() != 0) {
      return std::nullopt;
    }
  }
  rejected_sequence_ = rejected.sequence();
  conflict_.reset();
  if (rejected.has_current()) {
    absl::StatusOr<CurrentPose> current =
        FromProto(rejected.current(), joined_.dimension);
    if (!current.ok()) return Refuse(current.status());
    conflict_ = *std::move(current);
  }
  return FromRpcStatus(rejected.status());
}

void DeformStream::Impl::HandleParticipants() {
  const v1::Participants& changed = response_.participants();
  if (changed.complete()) known_.clear();
  for (const v1::Participant& participant : changed.participants()) {
    known_[participant.participant_id()] = FromProto(participant);
  }
  for (const uint64_t id : changed.left()) known_.erase(id);
  participants_.clear();
  for (const auto& [id, info] : known_) participants_.push_back(info);
  if (options_.on_participants) options_.on_participants(participants_);
}

absl::Status DeformStream::Impl::Refuse(const absl::Status& status) {
  reader_->Cancel();
  reader_->Finish().IgnoreError();
  return End(status);
}

absl::Status DeformStream::Impl::End(const absl::Status& status) {
  ended_ = true;
  end_ = status;
  MutexLock lock(mutex_);
  over_ = true;
  return end_;
}

}  // namespace deform
