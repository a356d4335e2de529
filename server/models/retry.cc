#include "server/models/retry.h"

#include "absl/strings/cord.h"

namespace deform::server {
namespace {

constexpr char kPayload[] = "deformd/retry-later";

}  // namespace

absl::Status RetryLater(absl::Status status) {
  status.SetPayload(kPayload, absl::Cord());
  return status;
}

bool MayDoLater(const absl::Status& status) {
  return status.code() == absl::StatusCode::kUnavailable ||
         status.GetPayload(kPayload).has_value();
}

}  // namespace deform::server
