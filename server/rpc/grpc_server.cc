#include "server/rpc/grpc_server.h"

#include <grpc/grpc.h>
#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

#include <thread>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "grpcpp/ext/proto_server_reflection_plugin.h"
#include "grpcpp/grpcpp.h"
#include "grpcpp/health_check_service_interface.h"
#include "grpcpp/resource_quota.h"
#include "server/rpc/binding_service.h"
#include "server/rpc/calls.h"
#include "server/rpc/deform_reactor.h"
#include "server/rpc/model_service.h"
#include "server/rpc/server_service.h"
#include "server/rpc/session_service.h"

namespace deform::server {
namespace {

// Large enough for a pose, a rig or an exit face per point; models come in
// chunks.
constexpr int kMaxReceiveBytes = 64 << 20;
constexpr int kMaxStreamsPerConnection = 1000;
// Clients may ping this often, also without calls; the server looks after
// silent connections itself, so that a pulled cable does not hold a session's
// seat for hours.
constexpr int kMinPingIntervalMs = 10'000;
constexpr int kKeepaliveTimeMs = 60'000;
constexpr int kKeepaliveTimeoutMs = 20'000;

constexpr std::chrono::milliseconds kStallCheckInterval{200};
constexpr std::chrono::milliseconds kDrainPollInterval{5};
// For the last words of streams that are cancelled.
constexpr std::chrono::milliseconds kCancelGrace{500};

void Configure(const GrpcServer::Options& options,
               grpc::ServerBuilder& builder) {
  builder.SetMaxReceiveMessageSize(kMaxReceiveBytes);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS,
                             kMaxStreamsPerConnection);
  builder.AddChannelArgument(
      GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
      kMinPingIntervalMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveTimeMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                             kKeepaliveTimeoutMs);
  builder.SetSyncServerOption(grpc::ServerBuilder::NUM_CQS, 1);
  builder.SetResourceQuota(
      grpc::ResourceQuota("deformd").SetMaxThreads(options.max_call_threads));
}

// What matters of gRPC's own words, such as one for every address that it
// cannot listen on, we say ourselves.
void LogOfGrpc(gpr_log_func_args* line) {
  spdlog::debug("gRPC: {}", line->message);
}

// Kept for ever: gRPC's own end may wait 10 s for one of its pollers.
void InitGrpc() {
  [[maybe_unused]] static const bool kept = [] {
    gpr_set_log_function(LogOfGrpc);
    grpc_init();
    return true;
  }();
}

// `listen` with the port that was chosen.
std::string AddressOf(const std::string& listen, int port) {
  if (listen.rfind("unix:", 0) == 0) return listen;
  return absl::StrCat(listen.substr(0, listen.rfind(':')), ":", port);
}

class GrpcServerImpl final : public GrpcServer {
 public:
  GrpcServerImpl(const Options& options, const Rooms& rooms)
      : bindings_(rooms.bindings),
        sessions_(rooms.sessions),
        calls_(rooms.sessions.clock(), options.stall_timeout),
        streams_(rooms.sessions, options.stall_timeout),
        model_service_(calls_, rooms.models),
        binding_service_(calls_, rooms.bindings, rooms.sessions,
                         rooms.background, options.weight_tolerance),
        session_service_(calls_, rooms.sessions, streams_),
        server_service_(calls_, rooms, streams_) {}

  ~GrpcServerImpl() override {
    if (server_ != nullptr) Drain(std::chrono::milliseconds(0));
  }

  absl::Status Start(const Options& options) {
    InitGrpc();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    Configure(options, builder);
    int port = 0;
    builder.AddListeningPort(options.listen, grpc::InsecureServerCredentials(),
                             &port);
    builder.RegisterService(&model_service_);
    builder.RegisterService(&binding_service_);
    builder.RegisterService(&session_service_);
    builder.RegisterService(&server_service_);
    server_ = builder.BuildAndStart();
    if (server_ == nullptr || port == 0) {
      return MakeError(absl::StatusCode::kUnavailable,
                       absl::StrCat("cannot listen on ", options.listen,
                                    ": not an address of this machine, or in "
                                    "use"),
                       {.reason = "CANNOT_LISTEN", .field = "listen"});
    }
    address_ = AddressOf(options.listen, port);
    stall_checks_ = std::thread([this] { CheckStalls(); });
    return absl::OkStatus();
  }

  const std::string& address() const override { return address_; }

  bool Drain(std::chrono::milliseconds patience) override {
    const auto end = std::chrono::steady_clock::now() + patience;
    server_->GetHealthCheckService()->SetServingStatus(false);
    calls_.Refuse(Draining());
    bindings_.compressor().Stop();
    sessions_.Drain();
    while (Busy() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(kDrainPollInterval);
    }
    const bool done = !Busy();
    // gRPC's own services may still stream: they are cut off.
    server_->Shutdown(std::chrono::system_clock::now() +
                      (done ? std::chrono::milliseconds(0) : kCancelGrace));
    server_->Wait();
    {
      MutexLock lock(mutex_);
      stopping_ = true;
    }
    wake_.NotifyAll();
    if (stall_checks_.joinable()) stall_checks_.join();
    server_.reset();
    return done;
  }

 private:
  bool Busy() const { return calls_.active() > 0 || streams_.size() > 0; }

  void CheckStalls() {
    MutexLock lock(mutex_);
    while (!stopping_) {
      wake_.WaitFor(mutex_, kStallCheckInterval);
      mutex_.Unlock();
      calls_.CheckStalls();
      streams_.CheckStalls();
      mutex_.Lock();
    }
  }

  BindingRegistry& bindings_;
  SessionManager& sessions_;
  CallRunner calls_;
  DeformStreams streams_;
  ModelService model_service_;
  BindingService binding_service_;
  SessionService session_service_;
  ServerService server_service_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;

  Mutex mutex_;
  CondVar wake_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread stall_checks_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<GrpcServer>> GrpcServer::Start(
    const Options& options, const Rooms& rooms) {
  auto server = std::make_unique<GrpcServerImpl>(options, rooms);
  if (absl::Status status = server->Start(options); !status.ok()) {
    return status;
  }
  return server;
}

}  // namespace deform::server
