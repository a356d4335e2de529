#include "server/models/binding_registry.h"

#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/content_id.h"

namespace deform::server {
namespace {

std::string BindingId(const BindSpec& spec) {
  ContentHash hash("binding");
  hash.Add(spec.tenant).Add(spec.model_id).Add(spec.scheme);
  hash.Add(RestVertices(spec.rig));
  if (const Cage* cage = std::get_if<Cage>(&spec.rig)) hash.Add(cage->faces());
  hash.Add(int64_t{DimensionOf(spec.rig)});
  hash.Add(std::span<const double>(spec.options.handle_weights));
  hash.Add(spec.options.lambda);
  hash.Add(static_cast<int64_t>(spec.exits.kind));
  hash.Add(std::span<const int32_t>(spec.exits.faces));
  hash.Add(std::span<const int32_t>(spec.exits.face_of_point));
  hash.Add(static_cast<int64_t>(spec.unbindable));
  return "b-" + hash.Finish();
}

// What a binding will hold: weights, the rig, and a list of points at worst.
int64_t BytesOf(const Rig& rig, const CoordinateScheme& scheme,
                int64_t points) {
  int64_t columns = RestVertices(rig).rows();
  int64_t corners = 0;
  if (const Cage* cage = std::get_if<Cage>(&rig)) {
    corners = cage->faces().size();
    if (scheme.uses_normals()) columns += cage->face_count();
  }
  const int64_t tiles = (points + kTilePoints - 1) / kTilePoints;
  return tiles * kTilePoints * columns * int64_t{sizeof(float)} +
         RestVertices(rig).size() * int64_t{sizeof(double)} +
         corners * int64_t{sizeof(int32_t)} + points * int64_t{sizeof(int64_t)};
}

}  // namespace

// One computation, owned by whoever waits for it or runs it.
struct BindingRegistry::Job {
  Job(Key k, BindRequest r) : key(std::move(k)), request(std::move(r)) {}

  const Key key;
  const BindRequest request;
  int64_t points_total = 0;
  std::atomic<int64_t> points_done{0};
  Cancellation cancellation;
  // Until Compute() takes them.
  MemoryBudget::Reservation memory;
  ModelCatalogue::Lease model;
  // Guarded by the registry's mutex.
  int waiters = 0;
  std::optional<absl::StatusOr<CreatedBinding>> outcome;
};

BindingRegistry::BindingRegistry(ModelRegistry& models, ThreadPool& pool,
                                 const Limits& limits, BindFunction bind)
    : limits_(limits),
      bind_(std::move(bind)),
      models_(models),
      pool_(pool),
      budget_(limits.memory, "max-bindings-memory"),
      bindings_("binding", limits.count, "max-bindings") {}

BindingRegistry::~BindingRegistry() {
  MutexLock lock(mutex_);
  for (const auto& [key, job] : jobs_) job->cancellation.Cancel();
  queue_.clear();
  while (running_ > 0) changed_.Wait(mutex_);
}

absl::StatusOr<std::unique_ptr<BindingRegistry::Waiter>>
BindingRegistry::Create(BindSpec spec) {
  const Key key(spec.tenant, BindingId(spec));
  MutexLock lock(mutex_);
  if (waiting_ >= limits_.waiting_calls) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat(waiting_,
                     " calls wait for bindings (max-waiting-binds): try again "
                     "later"),
        {.reason = "TOO_MANY_BINDS", .field = "max-waiting-binds"});
  }
  // Two calls that ask the same meet here: the lock is held until the job of
  // the first can be found by the second.
  std::shared_ptr<Job> job;
  const auto shared = jobs_.find(key);
  if (shared != jobs_.end() && !shared->second->cancellation.cancelled()) {
    job = shared->second;
  } else {
    DEFORM_ASSIGN_OR_RETURN(job, MakeJob(key, std::move(spec)));
    if (!job->outcome) {
      jobs_[key] = job;
      queue_.push_back(job);
    }
  }
  ++waiting_;
  ++job->waiters;
  StartJobs();
  return std::unique_ptr<Waiter>(new Waiter(*this, std::move(job)));
}

absl::StatusOr<std::shared_ptr<BindingRegistry::Job>> BindingRegistry::MakeJob(
    const Key& key, BindSpec spec) {
  BindRequest request{.model = nullptr,
                      .rig = std::move(spec.rig),
                      .scheme = std::move(spec.scheme),
                      .options = std::move(spec.options),
                      .exits = std::move(spec.exits),
                      .unbindable = spec.unbindable};
  if (auto found = bindings_.Find(key.first, key.second); found.ok()) {
    auto job = std::make_shared<Job>(key, std::move(request));
    job->points_done = (*found)->binding->point_count();
    job->points_total = job->points_done;
    job->outcome = CreatedBinding{*std::move(found), true};
    return job;
  }
  DEFORM_ASSIGN_OR_RETURN(const CoordinateScheme* scheme,
                          FindScheme(request.scheme));
  DEFORM_ASSIGN_OR_RETURN(
      auto model,
      models_.catalogue().Use(key.first, spec.model_id,
                              absl::StrCat("binding ", key.second)));
  request.model = model.record()->mesh;
  const int64_t points = request.model->size();
  DEFORM_ASSIGN_OR_RETURN(auto memory,
                          budget_.Reserve(BytesOf(request.rig, *scheme, points),
                                          "the binding needs"));
  auto job = std::make_shared<Job>(key, std::move(request));
  job->points_total = points;
  job->model = std::move(model);
  job->memory = std::move(memory);
  return job;
}

void BindingRegistry::StartJobs() {
  while (running_ < limits_.concurrent && !queue_.empty()) {
    ++running_;
    pool_.Submit([this, job = std::move(queue_.front())]() mutable {
      Run(std::move(job));
    });
    queue_.pop_front();
  }
}

void BindingRegistry::Run(std::shared_ptr<Job> job) {
  absl::StatusOr<CreatedBinding> outcome = Compute(*job);
  MutexLock lock(mutex_);
  job->outcome = std::move(outcome);
  // Another may have taken the place of a cancelled job.
  const auto found = jobs_.find(job->key);
  if (found != jobs_.end() && found->second == job) jobs_.erase(found);
  // The registry may go as soon as nothing runs, and a job holds parts of it.
  job.reset();
  --running_;
  StartJobs();
  changed_.NotifyAll();
}

absl::StatusOr<CreatedBinding> BindingRegistry::Compute(Job& job) try {
  // Whatever happens, a failed job gives the model and the memory back before
  // anyone learns of it.
  auto record = std::make_shared<BindingRecord>();
  record->model = std::move(job.model);
  record->memory = std::move(job.memory);
  if (job.cancellation.cancelled()) return absl::CancelledError();
  DEFORM_ASSIGN_OR_RETURN(
      record->binding, bind_(job.request, {.pool = &pool_,
                                           .cancellation = &job.cancellation,
                                           .points_done = &job.points_done}));
  record->tenant = job.key.first;
  record->id = job.key.second;
  record->model_id = record->model.record()->id;
  record->create_time = absl::Now();
  DEFORM_ASSIGN_OR_RETURN(
      auto inserted,
      bindings_.Insert(job.key.first, job.key.second, std::move(record)));
  return CreatedBinding{std::move(inserted.first), inserted.second};
} catch (const std::bad_alloc&) {
  return MakeError(absl::StatusCode::kResourceExhausted,
                   "the machine has no memory left for the computation",
                   {.reason = "OUT_OF_MEMORY", .field = "memory"});
}

void BindingRegistry::Abandon(const std::shared_ptr<Job>& job) {
  job->cancellation.Cancel();
  if (std::erase(queue_, job) > 0) jobs_.erase(job->key);
}

BindingRegistry::Waiter::~Waiter() {
  MutexLock lock(registry_.mutex_);
  --registry_.waiting_;
  if (--job_->waiters == 0) registry_.Abandon(job_);
}

std::optional<absl::StatusOr<CreatedBinding>> BindingRegistry::Waiter::Wait(
    std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  MutexLock lock(registry_.mutex_);
  while (!job_->outcome) {
    const auto left = end - std::chrono::steady_clock::now();
    if (left <= left.zero()) return std::nullopt;
    registry_.changed_.WaitFor(registry_.mutex_, left);
  }
  return job_->outcome;
}

BindProgress BindingRegistry::Waiter::progress() const {
  return {job_->points_done, job_->points_total};
}

}  // namespace deform::server
