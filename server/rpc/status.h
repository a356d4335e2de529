// Errors on the wire: canonical codes with google.rpc details.
#pragma once

#include "absl/status/status.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/support/status.h"

namespace deform::server {

// Longer messages are cut: a status travels in trailers, which are at most
// 8 KiB all together.
inline constexpr size_t kMaxMessageBytes = 1000;

// With ErrorInfo (domain "deformd"; the reason of an error without one is its
// code's name), and, where they apply: BadRequest (InvalidArgument with a
// field), QuotaFailure (ResourceExhausted with a field, its subject),
// ResourceInfo, RetryInfo (Unavailable).
google::rpc::Status ToRpcStatus(const absl::Status& status);

// The same as the outcome of a call.
grpc::Status ToGrpcStatus(const absl::Status& status);

}  // namespace deform::server
