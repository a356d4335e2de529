#include "server/rpc/calls.h"

#include <spdlog/spdlog.h>

#include <new>

#include "core/base/error.h"
#include "server/rpc/status.h"

namespace deform::server {

grpc::Status CallRunner::Run(absl::string_view call,
                             const grpc::ServerContext& context,
                             absl::FunctionRef<absl::Status()> body) {
  const auto begin = std::chrono::steady_clock::now();
  absl::Status status = Begin();
  try {
    if (status.ok()) status = body();
  } catch (const std::bad_alloc&) {
    status = MakeError(absl::StatusCode::kResourceExhausted,
                       "the machine has no memory left for this call",
                       {.reason = "OUT_OF_MEMORY", .field = "memory"});
  }
  End();
  LogCall(call, context.peer(), status,
          std::chrono::steady_clock::now() - begin);
  return ToGrpcStatus(status);
}

absl::Status CallRunner::Begin() {
  MutexLock lock(mutex_);
  ++active_;
  return refusal_.value_or(absl::OkStatus());
}

void CallRunner::End() {
  MutexLock lock(mutex_);
  --active_;
}

void CallRunner::Refuse(const absl::Status& status) {
  MutexLock lock(mutex_);
  refusal_ = status;
}

int CallRunner::active() const {
  MutexLock lock(mutex_);
  return active_;
}

void LogCall(absl::string_view call, const std::string& peer,
             const absl::Status& status, std::chrono::nanoseconds latency) {
  const double ms = std::chrono::duration<double, std::milli>(latency).count();
  const std::string name(call);
  if (status.ok()) {
    spdlog::info("{} OK {:.3f} ms from {}", name, ms, peer);
    return;
  }
  spdlog::info("{} {} {} {:.3f} ms from {}: {}", name,
               absl::StatusCodeToString(status.code()), DetailOf(status).reason,
               ms, peer, std::string(status.message()));
}

CallRunner::PeerWait::PeerWait(CallRunner& calls, grpc::ServerContext& context)
    : calls_(calls), context_(context), since_(calls.clock_()) {
  MutexLock lock(calls_.mutex_);
  calls_.waits_.insert(this);
}

CallRunner::PeerWait::~PeerWait() {
  MutexLock lock(calls_.mutex_);
  calls_.waits_.erase(this);
}

void CallRunner::CheckStalls() {
  const auto now = clock_();
  MutexLock lock(mutex_);
  for (const PeerWait* wait : waits_) {
    if (now - wait->since_ > stall_timeout_) wait->context_.TryCancel();
  }
}

}  // namespace deform::server
