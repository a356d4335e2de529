#include "client/cpp/deform_call.h"

#include <grpcpp/client_context.h>
#include <grpcpp/support/client_callback.h>

#include <atomic>
#include <memory>
#include <optional>
#include <utility>

#include "client/cpp/convert.h"
#include "client/cpp/deform_call_impl.h"
#include "client/cpp/frame_assembler.h"
#include "client/cpp/status.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

// Reads one message after the other; writes are started by Send(), outside of
// gRPC's reactions, for which it wants a hold on the call.
class Call final
    : public DeformCall,
      private grpc::ClientBidiReactor<v1::DeformRequest, v1::DeformResponse> {
 public:
  Call(v1::SessionService::Stub& stub, const v1::Join& join,
       const DeformOptions& options, DeformEvents& events)
      : events_(events),
        normals_(options.normals),
        held_weights_(options.weights),
        held_basis_(options.basis),
        weights_(options.pool) {
    MutexLock lock(mutex_);  // What is set up here is seen by reactions.
    stub.async()->Deform(&context_, this);
    *request_.mutable_join() = join;
    AddHold();
    StartWrite(&request_);
    ReadNext();
    StartCall();
  }

  ~Call() override {
    context_.TryCancel();
    MutexLock lock(mutex_);
    while (!done_) done_changed_.Wait(mutex_);
  }

  bool Send(const PoseUpdate& update) override {
    MutexLock lock(mutex_);
    if (!joined_ || writing_ || closing_ || !held_) return false;
    *request_.mutable_pose() = ToProto(update, dimension_, ++sequence_);
    writing_ = true;
    StartWrite(&request_);
    return true;
  }

  void Close() override {
    MutexLock lock(mutex_);
    closing_ = true;
    if (!writing_) HalfClose();
  }

  void Cancel() override { context_.TryCancel(); }

 private:
  void OnWriteDone(bool ok) override {
    bool sent = false;
    {
      MutexLock lock(mutex_);
      writing_ = false;
      sent = ok && joined_;
      if (closing_) HalfClose();
    }
    // If it failed, reading tells why.
    if (sent) events_.OnSent();
  }

  void OnReadDone(bool ok) override {
    turn_.load(std::memory_order_acquire);
    if (ok && in_band_.ok()) in_band_ = Handle();
    if (ok) {
      // What follows an error is read and dropped, up to the end.
      if (!in_band_.ok()) context_.TryCancel();
      ReadNext();
      return;
    }
    turn_.store(true, std::memory_order_release);
    MutexLock lock(mutex_);
    LetGo();
  }

  void OnDone(const grpc::Status& status) override {
    turn_.load(std::memory_order_acquire);
    // What was said in the stream says more than how the stream broke.
    events_.OnEnd(in_band_.ok() ? FromGrpc(status) : in_band_);
    MutexLock lock(mutex_);
    done_ = true;
    done_changed_.NotifyAll();
  }

  void ReadNext() {
    turn_.store(true, std::memory_order_release);
    StartRead(&response_);
  }

  // One message. An error ends the call.
  absl::Status Handle() {
    switch (response_.message_case()) {
      case v1::DeformResponse::kJoined:
        return HandleJoined();
      case v1::DeformResponse::kFrame:
        return HandleFrame();
      case v1::DeformResponse::kPointOrder:
        if (!assembler_) return NotJoined();
        return assembler_->AddOrder(response_.point_order());
      case v1::DeformResponse::kRigChanged: {
        DEFORM_ASSIGN_OR_RETURN(const RigChange change,
                                FromProto(response_.rig_changed(), dimension_));
        if (!assembler_) return NotJoined();
        assembler_->BeginBinding(change.binding_id);
        events_.OnRigChange(change);
        return absl::OkStatus();
      }
      case v1::DeformResponse::kRejected:
        events_.OnRejected(response_.rejected().sequence(),
                           FromRpcStatus(response_.rejected().status()));
        return absl::OkStatus();
      case v1::DeformResponse::kEnded:
        return FromRpcStatus(response_.ended());
      default:  // Messages of a later version of the protocol.
        return absl::OkStatus();
    }
  }

  static absl::Status NotJoined() {
    return absl::InternalError("the server did not answer a join");
  }

  absl::Status HandleJoined() {
    DEFORM_ASSIGN_OR_RETURN(const JoinedSession joined,
                            FromProto(response_.joined()));
    if (held_weights_.binding != nullptr) {
      DEFORM_RETURN_IF_ERROR(HeldWeights::Check(held_weights_, joined));
      weights_.Add(held_weights_, joined.binding_id);
    }
    if (held_basis_.basis != nullptr) {
      DEFORM_RETURN_IF_ERROR(HeldWeights::Check(held_basis_, joined));
      weights_.Add(held_basis_);
    }
    assembler_.emplace(joined.dimension, joined.point_count, normals_,
                       &weights_);
    assembler_->BeginBinding(joined.binding_id);
    {
      MutexLock lock(mutex_);
      dimension_ = joined.dimension;
      joined_ = true;
    }
    events_.OnJoined(joined);
    return absl::OkStatus();
  }

  absl::Status HandleFrame() {
    if (!assembler_) return NotJoined();
    DEFORM_ASSIGN_OR_RETURN(const bool complete,
                            assembler_->Add(response_.frame(), frame_));
    if (complete) events_.OnFrame(frame_);
    return absl::OkStatus();
  }

  void HalfClose() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (!held_) return;
    StartWritesDone();
    LetGo();
  }

  // No operation of ours follows outside of a reaction.
  void LetGo() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (std::exchange(held_, false)) RemoveHold();
  }

  DeformEvents& events_;
  const bool normals_;  // Were asked for.
  const HeldBinding held_weights_;
  const HeldBasis held_basis_;
  grpc::ClientContext context_;

  // The reading side's. Its reactions come one after the other, on any thread;
  // each hands over to the next. gRPC sees to that, but a sanitizer does not
  // see into gRPC.
  std::atomic<bool> turn_ = false;
  v1::DeformResponse response_;
  HeldWeights weights_;
  std::optional<FrameAssembler> assembler_;
  Frame frame_;
  absl::Status in_band_;

  Mutex mutex_;
  CondVar done_changed_;
  v1::DeformRequest request_;  // Belongs to gRPC while writing.
  int dimension_ = 3;          // Written once, by the reading side.
  bool joined_ ABSL_GUARDED_BY(mutex_) = false;
  bool writing_ ABSL_GUARDED_BY(mutex_) = true;  // Joining.
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool held_ ABSL_GUARDED_BY(mutex_) = true;
  bool done_ ABSL_GUARDED_BY(mutex_) = false;
  uint64_t sequence_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace

std::unique_ptr<DeformCall> StartDeformCall(v1::SessionService::Stub& stub,
                                            const v1::Join& join,
                                            const DeformOptions& options,
                                            DeformEvents& events) {
  return std::make_unique<Call>(stub, join, options, events);
}

}  // namespace deform
