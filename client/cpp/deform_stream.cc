#include "client/cpp/deform_stream.h"

#include "client/cpp/deform_stream_impl.h"
#include "client/cpp/status.h"
#include "core/base/status_macros.h"

namespace deform {

Positions Frame::DoublePositions() const {
  const int64_t count = point_count();
  Positions result = Positions::Zero(count, 3);
  for (int64_t i = 0; i < count; ++i) {
    for (int k = 0; k < dimension; ++k) {
      result(i, k) = origin[k] + positions[i * dimension + k];
    }
  }
  return result;
}

DeformStream::Impl::Impl(v1::SessionService::Stub& stub)
    : call_(stub.Deform(&context_)) {}

DeformStream::Impl::~Impl() {
  if (!ended_) {
    context_.TryCancel();
    // gRPC wants every message read and the call finished before it is freed.
    v1::DeformResponse ignored;
    while (call_->Read(&ignored)) {
    }
    call_->Finish();
  }
}

absl::Status DeformStream::Impl::Join(const v1::Join& join) {
  v1::DeformRequest request;
  *request.mutable_join() = join;
  // A failed write shows in Read(), where the reason is.
  call_->Write(request);
  if (!call_->Read(&response_)) return End();
  if (response_.has_ended()) return End();
  if (!response_.has_joined()) {
    return absl::InternalError("the server did not answer a join");
  }
  DEFORM_ASSIGN_OR_RETURN(joined_, FromProto(response_.joined()));
  assembler_.emplace(joined_.dimension, joined_.point_count);
  return absl::OkStatus();
}

void DeformStream::Impl::Close() {
  // gRPC ends the program if a stream is closed twice, or written to after.
  if (!closed_) call_->WritesDone();
  closed_ = true;
}

absl::StatusOr<uint64_t> DeformStream::Impl::Send(const PoseUpdate& update,
                                                  uint64_t rig_changes) {
  if (closed_) {
    return absl::FailedPreconditionError("no pose can follow Close()");
  }
  v1::DeformRequest request;
  *request.mutable_pose() =
      ToProto(update, joined_.dimension, ++sequence_, rig_changes);
  if (!call_->Write(request)) {
    return absl::UnavailableError(
        "the stream has ended; receiving tells the reason");
  }
  return sequence_;
}

absl::Status DeformStream::Impl::RequestKeyframe() {
  if (closed_) {
    return absl::FailedPreconditionError("nothing can follow Close()");
  }
  v1::DeformRequest request;
  request.mutable_keyframe();
  if (!call_->Write(request)) {
    return absl::UnavailableError(
        "the stream has ended; receiving tells the reason");
  }
  return absl::OkStatus();
}

absl::Status DeformStream::Impl::Refuse(const absl::Status& status) {
  context_.TryCancel();
  in_band_ = status;
  return End();
}

absl::Status DeformStream::Impl::NextFrame(Frame& frame) {
  while (!ended_ && call_->Read(&response_)) {
    switch (response_.message_case()) {
      case v1::DeformResponse::kFrame: {
        const absl::StatusOr<bool> complete =
            assembler_->Add(response_.frame(), frame);
        if (!complete.ok()) return Refuse(complete.status());
        if (!*complete) break;
        told_changes_ = rig_changes_.size();
        return absl::OkStatus();
      }
      case v1::DeformResponse::kRigChanged: {
        absl::StatusOr<RigChange> change =
            FromProto(response_.rig_changed(), joined_.dimension);
        if (!change.ok()) return Refuse(change.status());
        rig_changes_.push_back(*std::move(change));
        break;
      }
      case v1::DeformResponse::kPointOrder: {
        const absl::Status status =
            assembler_->AddOrder(response_.point_order());
        if (!status.ok()) return Refuse(status);
        break;
      }
      case v1::DeformResponse::kRejected:
        rejected_sequence_ = response_.rejected().sequence();
        return FromRpcStatus(response_.rejected().status());
      case v1::DeformResponse::kEnded:
        in_band_ = FromRpcStatus(response_.ended());
        break;
      default:  // Messages of a later version of the protocol.
        break;
    }
  }
  return End();
}

absl::Status DeformStream::Impl::End() {
  if (ended_) return end_;
  if (response_.has_ended()) in_band_ = FromRpcStatus(response_.ended());
  v1::DeformResponse ignored;
  while (call_->Read(&ignored)) {
  }
  end_ = FromGrpc(call_->Finish());
  // What was said in the stream says more than how the stream broke.
  if (!in_band_.ok()) end_ = in_band_;
  if (end_.ok()) end_ = absl::OutOfRangeError("the stream was closed");
  ended_ = true;
  return end_;
}

DeformStream::DeformStream(std::unique_ptr<Impl> impl)
    : impl_(std::move(impl)) {}
DeformStream::DeformStream(DeformStream&&) noexcept = default;
DeformStream& DeformStream::operator=(DeformStream&&) noexcept = default;
DeformStream::~DeformStream() = default;

const JoinedSession& DeformStream::joined() const { return impl_->joined(); }
absl::StatusOr<uint64_t> DeformStream::Send(const PoseUpdate& update) {
  return impl_->Send(update, impl_->told_changes());
}
absl::StatusOr<uint64_t> DeformStream::Send(const PoseUpdate& update,
                                            uint64_t rig_changes) {
  return impl_->Send(update, rig_changes);
}
absl::Status DeformStream::RequestKeyframe() {
  return impl_->RequestKeyframe();
}
const std::vector<RigChange>& DeformStream::rig_changes() const {
  return impl_->rig_changes();
}
absl::Status DeformStream::NextFrame(Frame& frame) {
  return impl_->NextFrame(frame);
}
uint64_t DeformStream::rejected_sequence() const {
  return impl_->rejected_sequence();
}
bool DeformStream::ended() const { return impl_->ended(); }
void DeformStream::Close() { impl_->Close(); }
void DeformStream::Cancel() { impl_->Cancel(); }

}  // namespace deform
