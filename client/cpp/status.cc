#include "client/cpp/status.h"

#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"

namespace deform {
namespace {

absl::string_view View(const std::string& text) {
  return {text.data(), text.size()};
}

ErrorDetail ReadDetails(const google::rpc::Status& status) {
  ErrorDetail detail;
  for (const google::protobuf::Any& any : status.details()) {
    google::rpc::ErrorInfo info;
    google::rpc::BadRequest request;
    google::rpc::ResourceInfo resource;
    if (any.UnpackTo(&info)) {
      detail.reason = info.reason();
    } else if (any.UnpackTo(&request) && request.field_violations_size() > 0) {
      detail.field = request.field_violations(0).field();
    } else if (any.UnpackTo(&resource)) {
      detail.resource_type = resource.resource_type();
      detail.resource_name = resource.resource_name();
    }
  }
  return detail;
}

absl::StatusCode CodeOf(int code) {
  // Both count the canonical codes from 0 to 16.
  if (code < 0 || code > 16) return absl::StatusCode::kUnknown;
  return static_cast<absl::StatusCode>(code);
}

}  // namespace

absl::Status FromRpcStatus(const google::rpc::Status& status) {
  if (status.code() == 0) return absl::OkStatus();
  return MakeError(CodeOf(status.code()), View(status.message()),
                   ReadDetails(status));
}

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  google::rpc::Status wire;
  ErrorDetail detail;
  if (wire.ParseFromString(status.error_details())) detail = ReadDetails(wire);
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE &&
      detail.reason.empty()) {
    detail.reason = "SERVER_UNREACHABLE";
  }
  return MakeError(CodeOf(status.error_code()), View(status.error_message()),
                   detail);
}

}  // namespace deform
