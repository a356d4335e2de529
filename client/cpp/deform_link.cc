#include "client/cpp/deform_link.h"

#include "client/cpp/status.h"
#include "core/base/error.h"

namespace deform {

DeformLink::~DeformLink() {
  if (finished_) return;
  // gRPC wants every message read and the call finished before it is freed.
  Cancel();
  Finish().IgnoreError();
}

namespace {

absl::Status NotJoined() {
  return MakeError(absl::StatusCode::kInternal,
                   "the server did not answer a join",
                   {.reason = "BAD_ANSWER"});
}

}  // namespace

absl::StatusOr<v1::Joined> DeformLink::Join(const v1::Join& join) {
  v1::DeformRequest request;
  *request.mutable_join() = join;
  // A failed write shows in Read(), where the reason is.
  Write(request);
  v1::DeformResponse response;
  if (!Read(response)) {
    const absl::Status status = Finish();
    if (!status.ok()) return status;
    return NotJoined();
  }
  if (!response.has_joined()) {
    return NotJoined();
  }
  return std::move(*response.mutable_joined());
}

bool DeformLink::Read(v1::DeformResponse& response) {
  if (!call_->Read(&response)) return false;
  if (!response.has_ended()) return true;
  in_band_ = FromRpcStatus(response.ended());
  return false;
}

absl::Status DeformLink::Finish() {
  v1::DeformResponse response;
  while (call_->Read(&response)) {
    if (response.has_ended()) in_band_ = FromRpcStatus(response.ended());
  }
  const absl::Status status = FromGrpc(call_->Finish());
  finished_ = true;
  // What was said in the stream says more than how the stream broke.
  return in_band_.ok() ? status : in_band_;
}

bool IsResumable(const absl::Status& status) {
  const std::string reason = DetailOf(status).reason;
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
      return true;
    case absl::StatusCode::kInternal:
    case absl::StatusCode::kUnknown:
    case absl::StatusCode::kCancelled:
      return reason.empty();
    default:
      return reason == "RECEIVER_STALLED" || reason == "JOIN_TIMEOUT" ||
             reason == "TOO_MANY_PARTICIPANTS";
  }
}

}  // namespace deform
