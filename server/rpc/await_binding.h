// Waiting for weights on behalf of a caller.
#pragma once

#include <chrono>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "grpcpp/server_context.h"
#include "server/models/binding_registry.h"

namespace deform::server {

// Between two progress messages.
inline constexpr std::chrono::milliseconds kProgressInterval{200};

// A computation is stopped within a tile of the caller's leaving, which is
// looked for as often as this.
inline constexpr std::chrono::milliseconds kPollInterval{20};

// Waits for the binding and tells progress a few times a second, if there is
// any; `tell` returns whether the caller still listens. Cancelled when it does
// not.
absl::StatusOr<CreatedBinding> AwaitBinding(
    BindingRegistry::Waiter& waiter, const grpc::ServerContext& context,
    absl::FunctionRef<bool(const BindProgress&)> tell);

}  // namespace deform::server
