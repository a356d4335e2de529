#include "server/rpc/deform_reactor.h"

#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/rpc/calls.h"
#include "server/rpc/convert.h"
#include "server/rpc/frame_message.h"
#include "server/rpc/message_bytes.h"
#include "server/rpc/status.h"

namespace deform::server {

DeformReactor* DeformStreams::Open(grpc::CallbackServerContext* context) {
  auto reactor = std::make_shared<DeformReactor>(*this, context);
  {
    MutexLock lock(mutex_);
    reactors_.insert(reactor);
  }
  reactor->Start();
  return reactor.get();
}

void DeformStreams::Close(DeformReactor* reactor) {
  // Destroyed after the lock is released.
  const auto keep = reactor->shared_from_this();
  MutexLock lock(mutex_);
  reactors_.erase(keep);
}

size_t DeformStreams::size() const {
  MutexLock lock(mutex_);
  return reactors_.size();
}

void DeformStreams::CheckStalls() {
  std::vector<std::shared_ptr<DeformReactor>> reactors;
  {
    MutexLock lock(mutex_);
    reactors.assign(reactors_.begin(), reactors_.end());
  }
  const auto now = sessions_.clock()();
  for (const auto& reactor : reactors) reactor->CheckStall(now);
}

DeformReactor::DeformReactor(DeformStreams& streams,
                             grpc::CallbackServerContext* context)
    : streams_(streams),
      context_(context),
      begin_(streams.sessions_.clock()()),
      deadline_(begin_ + streams.stall_timeout_) {}

void DeformReactor::Start() {
  MutexLock lock(mutex_);
  reading_ = true;
  StartRead(&incoming_);
}

void DeformReactor::OnReadDone(bool ok) {
  v1::DeformRequest request;
  const bool parsed = ok && ParseMessage(incoming_, request);
  incoming_.Clear();
  if (parsed) HandleMessage(request);
  MutexLock lock(mutex_);
  reading_ = false;
  if (!ok) {
    half_closed_ = true;
    if (participant_ != nullptr) {
      participant_->HalfClose();
    } else {
      End(InvalidInput("JOIN_FIRST", "join",
                       "the stream ended before it joined a session"));
    }
  } else if (!parsed) {
    End(InvalidInput("MALFORMED_MESSAGE", "message",
                     "the message is no DeformRequest"));
  }
  Advance();
}

void DeformReactor::HandleMessage(const v1::DeformRequest& request) {
  const bool joined = participant() != nullptr;
  if (request.has_join() && !joined) {
    HandleJoin(request.join());
  } else if (request.has_pose() && joined) {
    HandlePose(request.pose());
  } else if (joined && HandleRequest(*participant(), request)) {
    return;
  } else {
    MutexLock lock(mutex_);
    End(joined ? InvalidInput("POSE_EXPECTED", "message",
                              "after joining, a stream has poses and the like: "
                              "it cannot join again, or say nothing")
               : InvalidInput("JOIN_FIRST", "join",
                              "the first message of a stream is join"));
  }
}

void DeformReactor::HandleJoin(const v1::Join& join) {
  const auto joining = [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const JoinRequest request, FromProto(join));
    DEFORM_ASSIGN_OR_RETURN(const auto session,
                            streams_.sessions_.catalogue().Find(
                                request.tenant, request.session_id));
    DEFORM_ASSIGN_OR_RETURN(const Introduction who, IntroductionOf(join));
    DEFORM_ASSIGN_OR_RETURN(
        Session::Joined joined,
        session->Join(request.delivery, request.frames, weak_from_this(), who));
    v1::Joined message;
    ToProto(joined, &message);
    MutexLock lock(mutex_);
    joined_ = std::move(message);
    participant_ = std::move(joined.participant);
    if (finished_) {
      participant_->Leave();
    } else {
      deadline_.reset();
    }
    return absl::OkStatus();
  };
  if (const absl::Status status = joining(); !status.ok()) {
    MutexLock lock(mutex_);
    End(status);
  }
}

void DeformReactor::HandlePose(const v1::Pose& pose) {
  Participant& participant = *this->participant();
  const bool accepted = participant.Submit(
      pose.sequence(), FromProto(pose, participant.session().dimension()),
      TermsOf(pose));
  streams_.counters_.CountPose(accepted);
  MutexLock lock(mutex_);
  ++poses_;
}

bool DeformReactor::HandleRequest(Participant& participant,
                                  const v1::DeformRequest& request) {
  switch (request.message_case()) {
    case v1::DeformRequest::kKeyframe:
      participant.WantKeyframe();
      return true;
    case v1::DeformRequest::kHeld:
      // Who names no weights that can be holds none.
      participant.Hold(FromProto(request.held()).value_or(WeightsId()));
      return true;
    case v1::DeformRequest::kLock:
      participant.Lock(request.lock().sequence(),
                       ToHandles(request.lock().vertices(), "lock.vertices"),
                       std::chrono::milliseconds(request.lock().lease_ms()),
                       request.lock().rig_changes());
      return true;
    case v1::DeformRequest::kUnlock:
      participant.Unlock(
          request.unlock().sequence(),
          ToHandles(request.unlock().vertices(), "unlock.vertices"),
          request.unlock().rig_changes());
      return true;
    case v1::DeformRequest::kPresence:
      participant.Show(FromProto(request.presence()));
      return true;
    case v1::DeformRequest::kUndo:
      participant.Reverse(request.undo().sequence(),
                          EditHistory::Direction::kUndo);
      return true;
    case v1::DeformRequest::kRedo:
      participant.Reverse(request.redo().sequence(),
                          EditHistory::Direction::kRedo);
      return true;
    default:
      return false;
  }
}

Participant* DeformReactor::participant() const {
  MutexLock lock(mutex_);
  return participant_.get();
}

void DeformReactor::OnWriteDone(bool ok) {
  MutexLock lock(mutex_);
  writing_ = false;
  // Broken: OnCancel() ends it.
  if (!ok) return;
  if (participant_ != nullptr) participant_->Progressed();
  Advance();
}

void DeformReactor::Wake() {
  MutexLock lock(mutex_);
  Advance();
}

void DeformReactor::Advance() {
  if (finished_ || participant_ == nullptr) return;
  if (!writing_) StartNextWrite();
  if (!finished_ && !reading_ && !half_closed_ && participant_->WantsPoses()) {
    reading_ = true;
    StartRead(&incoming_);
  }
}

void DeformReactor::StartNextWrite() {
  if (joined_) {
    v1::DeformResponse response;
    *response.mutable_joined() = *std::move(joined_);
    joined_.reset();
    participant_->Progressed();
    Write(response);
    return;
  }
  if (in_progress_) {
    WriteNext();
    return;
  }
  std::optional<Outgoing> next = participant_->Take();
  if (!next) return;
  if (auto* frame = std::get_if<FrameToSend>(&*next)) {
    const size_t chunks = frame->frame->chunks.size();
    in_progress_ = InProgress{.what = std::move(*frame), .messages = chunks};
    WriteNext();
  } else if (auto* order = std::get_if<OrderToSend>(&*next)) {
    const size_t messages = OrderMessages(*order->order);
    in_progress_ = InProgress{.what = std::move(*order), .messages = messages};
    WriteNext();
  } else if (auto* changed = std::get_if<RigChanged>(&*next)) {
    v1::DeformResponse response;
    ToProto(*changed->change, response.mutable_rig_changed());
    Write(response);
  } else if (auto* rejection = std::get_if<Rejection>(&*next)) {
    v1::DeformResponse response;
    ToProto(*rejection, response.mutable_rejected());
    Write(response);
  } else if (auto* done = std::get_if<Acknowledgement>(&*next)) {
    v1::DeformResponse response;
    ToProto(*done, response.mutable_acknowledged());
    Write(response);
  } else if (auto* presence = std::get_if<PresenceChange>(&*next)) {
    v1::DeformResponse response;
    ToProto(*presence, streams_.sessions_.clock()(),
            response.mutable_participants());
    Write(response);
  } else {
    End(std::get<Ended>(*next).status);
  }
}

void DeformReactor::WriteNext() {
  const size_t part = in_progress_->next++;
  const bool last = in_progress_->next == in_progress_->messages;
  if (const auto* frame = std::get_if<FrameToSend>(&in_progress_->what)) {
    const Session& session = participant_->session();
    outgoing_ =
        FrameMessage(*frame, part, session.epoch(), session.durable_revision());
    streams_.counters_.CountChunk(outgoing_.Length(), last);
    if (last) ++frames_;
  } else {
    outgoing_ =
        OrderMessage(std::get<OrderToSend>(in_progress_->what).order, part);
  }
  if (last) in_progress_.reset();
  writing_ = true;
  StartWrite(&outgoing_);
}

void DeformReactor::Write(const v1::DeformResponse& response) {
  outgoing_ = SerializeMessage(response);
  writing_ = true;
  StartWrite(&outgoing_);
}

void DeformReactor::End(const absl::Status& status) {
  if (finished_) return;
  finished_ = status;
  deadline_ = streams_.sessions_.clock()() + streams_.stall_timeout_;
  if (participant_ != nullptr) participant_->Leave();
  if (status.ok() || writing_) {
    Finish(ToGrpcStatus(status));
    return;
  }
  v1::DeformResponse response;
  *response.mutable_ended() = ToRpcStatus(status);
  outgoing_ = SerializeMessage(response);
  writing_ = true;
  StartWriteAndFinish(&outgoing_, grpc::WriteOptions(), ToGrpcStatus(status));
}

void DeformReactor::OnCancel() {
  MutexLock lock(mutex_);
  if (finished_) return;
  // Nobody listens any more; no in-band message.
  writing_ = true;
  End(absl::CancelledError("the caller left"));
}

void DeformReactor::CheckStall(TimePoint now) {
  MutexLock lock(mutex_);
  if (done_) return;
  const bool overdue = deadline_ && now >= *deadline_;
  if (finished_) {
    if (overdue) context_->TryCancel();
  } else if (overdue) {
    End(MakeError(absl::StatusCode::kDeadlineExceeded,
                  "the stream did not join a session in time (stall-timeout)",
                  {.reason = "JOIN_TIMEOUT", .field = "join"}));
  } else if (participant_ != nullptr) {
    const absl::Status status = participant_->CheckStall();
    if (!status.ok()) {
      End(status);
    } else {
      Advance();  // Others may have shown something meanwhile.
    }
  }
}

void DeformReactor::OnDone() {
  std::string call = "Deform";
  absl::Status status;
  {
    MutexLock lock(mutex_);
    if (participant_ != nullptr) {
      absl::StrAppend(&call, " session ", participant_->session().id(), ", ",
                      poses_, " poses, ", frames_, " frames,");
    }
    status = *finished_;
    done_ = true;
    // It went as it wanted to, and knows: nobody will come back.
    if (participant_ != nullptr && status.ok() && !context_->IsCancelled()) {
      participant_->Forget();
    }
  }
  LogCall(call, context_->peer(), status,
          streams_.sessions_.clock()() - begin_);
  streams_.Close(this);
}

}  // namespace deform::server
