// Errors from the wire: grpc::Status and google.rpc details become absl::Status
// with the detail of core/base/error.h.
#pragma once

#include <grpcpp/support/status.h>

#include "absl/status/status.h"
#include "google/rpc/status.pb.h"

namespace deform {

// Keeps code and message; takes reason, field and resource from the details, if
// they are there and can be read. An Unavailable without a reason comes from
// the connection and gets SERVER_UNREACHABLE.
absl::Status FromGrpc(const grpc::Status& status);

// The same for a status that came inside a message.
absl::Status FromRpcStatus(const google::rpc::Status& status);

}  // namespace deform
