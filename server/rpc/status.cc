#include "server/rpc/status.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"
#include "server/models/names.h"
#include "server/models/retry.h"

namespace deform::server {
namespace {

constexpr char kDomain[] = "deformd";

// Cut between characters: Protobuf strings are UTF-8.
std::string Cut(absl::string_view text, size_t size) {
  if (text.size() <= size) return std::string(text);
  while (size > 0 && (text[size] & 0xC0) == 0x80) --size;
  return absl::StrCat(text.substr(0, size), "...");
}

void AddDetails(const absl::Status& status, const std::string& message,
                google::rpc::Status& rpc) {
  const ErrorDetail detail = DetailOf(status);
  google::rpc::ErrorInfo info;
  info.set_reason(detail.reason.empty()
                      ? absl::StatusCodeToString(status.code())
                      : detail.reason);
  info.set_domain(kDomain);
  rpc.add_details()->PackFrom(info);
  if (status.code() == absl::StatusCode::kInvalidArgument &&
      !detail.field.empty()) {
    google::rpc::BadRequest bad;
    auto* violation = bad.add_field_violations();
    violation->set_field(detail.field);
    violation->set_description(message);
    rpc.add_details()->PackFrom(bad);
  }
  if (status.code() == absl::StatusCode::kResourceExhausted &&
      !detail.field.empty()) {
    google::rpc::QuotaFailure quota;
    auto* violation = quota.add_violations();
    violation->set_subject(detail.field);
    violation->set_description(message);
    rpc.add_details()->PackFrom(quota);
  }
  if (!detail.resource_type.empty()) {
    google::rpc::ResourceInfo resource;
    resource.set_resource_type(detail.resource_type);
    resource.set_resource_name(Cut(detail.resource_name, kMaxNameBytes));
    rpc.add_details()->PackFrom(resource);
  }
  if (MayDoLater(status)) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_seconds(1);
    rpc.add_details()->PackFrom(retry);
  }
}

}  // namespace

google::rpc::Status ToRpcStatus(const absl::Status& status) {
  google::rpc::Status rpc;
  rpc.set_code(static_cast<int>(status.code()));
  if (status.ok()) return rpc;
  const std::string message = Cut(status.message(), kMaxMessageBytes);
  rpc.set_message(message);
  AddDetails(status, message, rpc);
  return rpc;
}

grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const google::rpc::Status rpc = ToRpcStatus(status);
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()),
                      rpc.message(), rpc.SerializeAsString());
}

}  // namespace deform::server
