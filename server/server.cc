#include "server/server.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "core/base/thread_pool.h"
#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/rpc/grpc_server.h"
#include "server/sessions/batch_scheduler.h"
#include "server/sessions/session_manager.h"
#include "server/sessions/timer.h"
#include "server/stores/store.h"

namespace deform::server {
namespace {

// Binding yields to sessions.
constexpr int kBackgroundNiceness = 10;
// Compressing yields to all else: nobody waits for it.
constexpr int kCompressionNiceness = 15;
constexpr int kWakingThreads = 4;

void Warn(const absl::Status& status) {
  spdlog::warn("{}", std::string(status.message()));
}

ModelRegistry::Limits ModelLimits(const Options& options) {
  return {.model_bytes = options.max_model_bytes.value,
          .memory = options.max_models_memory.value,
          .count = options.max_models};
}

BindingRegistry::Limits BindingLimits(const Options& options) {
  return {.memory = options.max_bindings_memory.value,
          .count = options.max_bindings,
          .concurrent = options.max_concurrent_binds,
          .waiting_calls = options.max_waiting_binds};
}

Compressor::Options CompressionOptions(ThreadPool& pool) {
  return {
      .executor =
          [&pool](std::function<void()> task) { pool.Submit(std::move(task)); },
      .pool = &pool};
}

WeightsKeeper::Options KeepingOptions(ThreadPool& writes) {
  return {.executor =
              [&writes](std::function<void()> task) {
                writes.Submit(std::move(task));
              },
          .report = [](const absl::Status& status) { Warn(status); }};
}

BatchScheduler::Options BatchOptions(ThreadPool& compute) {
  return {.executor =
              [&compute](std::function<void()> task) {
                compute.Submit(std::move(task));
              },
          .pool = &compute,
          .concurrent = compute.threads()};
}

SessionEnvironment EnvironmentOf(const Options& options,
                                 BatchScheduler& scheduler, Allowance& drags,
                                 Timer& timer) {
  return {.scheduler = &scheduler,
          .drags = &drags,
          .clock = [] { return std::chrono::steady_clock::now(); },
          .max_participants = options.max_participants,
          .stall_timeout = options.stall_timeout.milliseconds(),
          .resume_grace = options.resume_grace.milliseconds(),
          .call_at =
              [&timer](Timer::TimePoint time, std::function<void()> task) {
                timer.At(time, std::move(task));
              },
          .report = [](const absl::Status& status) { Warn(status); }};
}

absl::StatusOr<std::unique_ptr<Store>> OpenStore(const Options& options) {
  DEFORM_ASSIGN_OR_RETURN(
      const StoreKind* kind,
      FindStoreKind(options.in_memory ? "memory" : "sqlite"));
  return kind->Open({.directory = options.data_dir});
}

void Warn(const Losses& losses) {
  for (const absl::Status& loss : losses) Warn(loss);
}

}  // namespace

// From the bottom up.
struct Server::Parts {
  Parts(const Options& options, std::unique_ptr<Store> opened)
      : store(std::move(opened)),
        backups(*store, PosixFileSystem(), options.data_dir + "/backups",
                options.max_backups),
        compute(std::make_unique<ThreadPool>(
            ThreadPool::Options{.threads = options.compute_threads})),
        binds({.threads = options.compute_threads,
               .niceness = kBackgroundNiceness}),
        background({.threads = options.compute_threads,
                    .niceness = kBackgroundNiceness}),
        compressions({.threads = options.compute_threads,
                      .niceness = kCompressionNiceness}),
        writes({.threads = 1, .niceness = kBackgroundNiceness}),
        wakes(std::make_unique<ThreadPool>(
            ThreadPool::Options{.threads = kWakingThreads})),
        models(ModelLimits(options), *store),
        bindings(models, binds, BindingLimits(options), &Bind,
                 CompressionOptions(compressions), KeepingOptions(writes)),
        scheduler(BatchOptions(*compute)),
        drags(options.max_drags_memory.value),
        sessions(bindings,
                 {.memory = options.max_sessions_memory.value,
                  .count = options.max_sessions},
                 EnvironmentOf(options, scheduler, drags, timer),
                 [this](std::function<void()> task) {
                   wakes->Submit(std::move(task));
                 }) {}

  // Before anyone is served.
  absl::Status Load() {
    DEFORM_ASSIGN_OR_RETURN(const StoreContents contents, store->Load());
    Warn(contents.damaged);
    DEFORM_ASSIGN_OR_RETURN(Losses losses, models.Load(contents.models));
    Warn(losses);
    DEFORM_ASSIGN_OR_RETURN(losses, bindings.Load(contents.bindings));
    Warn(losses);
    DEFORM_ASSIGN_OR_RETURN(losses, sessions.Load(contents.sessions));
    Warn(losses);
    return absl::OkStatus();
  }

  // Streams end first; then the steps they left behind, which hold sessions;
  // then the rest, from the top down.
  ~Parts() {
    grpc.reset();
    timer.Stop();
    sessions.StopWaiting();
    wakes.reset();
    compute.reset();
  }

  const std::unique_ptr<Store> store;
  BackupFolder backups;
  std::unique_ptr<ThreadPool> compute;  // Deforming and encoding.
  ThreadPool binds;                     // Weights.
  ThreadPool background;  // Weights again, for those who ask to see them.
  ThreadPool compressions;
  ThreadPool writes;  // Weights to the store: waits for the disk.
  // Wait for the weights of stored sessions that are wanted again.
  std::unique_ptr<ThreadPool> wakes;
  ModelRegistry models;
  BindingRegistry bindings;
  BatchScheduler scheduler;
  Allowance drags;
  Timer timer;  // For receivers of few frames.
  SessionManager sessions;
  std::unique_ptr<GrpcServer> grpc;
};

absl::StatusOr<std::unique_ptr<Server>> Server::Start(const Options& options) {
  DEFORM_ASSIGN_OR_RETURN(auto store, OpenStore(options));
  auto parts = std::make_unique<Parts>(options, std::move(store));
  DEFORM_RETURN_IF_ERROR(parts->Load());
  DEFORM_ASSIGN_OR_RETURN(
      parts->grpc,
      GrpcServer::Start({.listen = options.listen,
                         .max_call_threads = options.max_call_threads,
                         .stall_timeout = options.stall_timeout.milliseconds(),
                         .weight_tolerance = options.weight_tolerance.value},
                        {.models = parts->models,
                         .bindings = parts->bindings,
                         .sessions = parts->sessions,
                         .background = parts->background,
                         .backups = parts->backups}));
  return std::unique_ptr<Server>(new Server(std::move(parts)));
}

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Server::~Server() = default;

const std::string& Server::address() const { return parts_->grpc->address(); }

bool Server::Drain(std::chrono::milliseconds patience) {
  const bool done = parts_->grpc->Drain(patience);
  // What was answered is durable when this returns.
  if (const absl::Status synced = parts_->store->Sync(); !synced.ok()) {
    Warn(synced);
  }
  return done;
}

}  // namespace deform::server
