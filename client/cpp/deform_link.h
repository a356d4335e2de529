// One connection of a DeformStream; for deform_stream*.cc only.
#pragma once

#include <grpcpp/client_context.h>

#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "deform/v1/session.grpc.pb.h"

namespace deform {

// One thread may write while another reads; Cancel() may be called from any.
class DeformLink {
 public:
  explicit DeformLink(v1::SessionService::Stub& stub)
      : call_(stub.Deform(&context_)) {}
  // Cancels what is still under way.
  ~DeformLink();

  // The first call. Waits for the server's answer.
  absl::StatusOr<v1::Joined> Join(const v1::Join& join);

  // False: the stream has ended; Finish() tells why.
  bool Write(const v1::DeformRequest& request) { return call_->Write(request); }
  void WritesDone() { call_->WritesDone(); }
  bool Read(v1::DeformResponse& response);
  // Reads to the end, and returns the reason: OK if the server was done.
  absl::Status Finish();
  void Cancel() { context_.TryCancel(); }

 private:
  grpc::ClientContext context_;
  const std::unique_ptr<
      grpc::ClientReaderWriter<v1::DeformRequest, v1::DeformResponse>>
      call_;
  bool finished_ = false;
  absl::Status in_band_;
};

// Whether a stream that ended so, and not because we wanted it, may go on as
// another: the connection broke, or the server said so for a reason that
// passes. Proxies report a broken connection as Internal or Unknown, too; the
// server's own errors have a reason.
bool IsResumable(const absl::Status& status);

}  // namespace deform
