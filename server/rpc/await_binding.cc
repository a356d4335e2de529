#include "server/rpc/await_binding.h"

#include <utility>

namespace deform::server {

absl::StatusOr<CreatedBinding> AwaitBinding(
    BindingRegistry::Waiter& waiter, const grpc::ServerContext& context,
    absl::FunctionRef<bool(const BindProgress&)> tell) {
  int64_t told = -1;
  auto told_at = std::chrono::steady_clock::now() - kProgressInterval;
  for (;;) {
    if (auto outcome = waiter.Wait(kPollInterval)) return *std::move(outcome);
    if (context.IsCancelled()) return absl::CancelledError();
    const auto now = std::chrono::steady_clock::now();
    const BindProgress progress = waiter.progress();
    if (progress.points_done == told || now - told_at < kProgressInterval) {
      continue;
    }
    if (!tell(progress)) return absl::CancelledError();
    told = progress.points_done;
    told_at = now;
  }
}

}  // namespace deform::server
