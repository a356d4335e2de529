#include "server/models/binding_registry.h"

#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/content_id.h"
#include "server/models/process_memory.h"
#include "server/models/retry.h"

namespace deform::server {
namespace {

// Between two looks at whether a caller still wants to wait.
constexpr std::chrono::milliseconds kPollInterval{20};

std::string BindingId(const BindSpec& spec) {
  ContentHash hash("binding");
  hash.Add(spec.tenant).Add(spec.model_id).Add(spec.scheme);
  hash.Add(RestVertices(spec.rig)).Add(PoseRows(spec.rig));
  if (const Cage* cage = std::get_if<Cage>(&spec.rig)) hash.Add(cage->faces());
  hash.Add(int64_t{DimensionOf(spec.rig)});
  hash.Add(std::span<const double>(spec.options.handle_weights));
  hash.Add(spec.options.lambda);
  hash.Add(static_cast<int64_t>(spec.exits.kind));
  hash.Add(std::span<const int32_t>(spec.exits.faces));
  hash.Add(std::span<const int32_t>(spec.exits.face_of_point));
  hash.Add(static_cast<int64_t>(spec.unbindable));
  hash.Add(std::span<const int64_t>(spec.clamped));
  hash.Add(spec.weight_tolerance + 0.0);  // -0 is 0.
  return "b-" + hash.Finish();
}

int64_t ColumnsOf(const Rig& rig, const CoordinateScheme& scheme) {
  const Cage* cage = std::get_if<Cage>(&rig);
  return RestVertices(rig).rows() +
         (cage != nullptr && scheme.uses_normals() ? cage->face_count() : 0);
}

// What schemes of handles keep beside the weights.
int64_t SolutionBytes(const Rig& rig, int64_t points) {
  return std::holds_alternative<Cage>(rig)
             ? 0
             : 3 * points * int64_t{sizeof(float)};
}

// What will be known beside them, at worst: the request, and all points twice
// in lists.
int64_t FactBytes(const BindRequest& request) {
  const Cage* cage = std::get_if<Cage>(&request.rig);
  const int64_t indices =
      (cage != nullptr ? cage->faces().size() : 0) +
      static_cast<int64_t>(request.exits.faces.size()) +
      static_cast<int64_t>(request.exits.face_of_point.size());
  return (RestVertices(request.rig).size() + 2 * request.model->size() +
          std::ssize(request.clamped)) *
             int64_t{sizeof(double)} +
         indices * int64_t{sizeof(int32_t)};
}

absl::Status NeitherFormFits(absl::string_view why) {
  return MakeError(
      absl::StatusCode::kResourceExhausted,
      absl::StrCat("dense weights do not fit into max-bindings-memory, and ",
                   why),
      {.reason = "MEMORY_LIMIT", .field = "max-bindings-memory"});
}

}  // namespace

int64_t DenseWeightBytes(const BindingFacts& facts) {
  return WeightTiles::BytesFor(facts.point_count(), facts.column_count()) +
         SolutionBytes(facts.rig(), facts.point_count());
}

// One computation, owned by whoever waits for it or runs it.
struct BindingRegistry::Job {
  Job(Key k, BindRequest r)
      : key(std::move(k)),
        request(std::make_shared<const BindRequest>(std::move(r))) {}
  explicit Job(const std::shared_ptr<const BindingRecord>& record)
      : key(record->tenant, record->id),
        request(record, &record->facts.request()),
        weight_tolerance(record->weight_tolerance),
        known(record) {}

  const Key key;
  const std::shared_ptr<const BindRequest> request;
  double weight_tolerance = 0;
  // Whose weights are computed again; null for a new binding.
  const std::shared_ptr<const BindingRecord> known;
  // If dense weights do not fit: what those that are made without them may
  // take. Else 0.
  int64_t max_compressed_bytes = 0;
  int64_t points_total = 0;
  std::atomic<int64_t> points_done{0};
  Cancellation cancellation;
  // Until Compute() takes them.
  MemoryBudget::Reservation memory;
  ModelCatalogue::Lease model;                       // Of a new binding.
  std::shared_ptr<const Solutions> known_solutions;  // Or null.
  // Guarded by the registry's mutex.
  int waiters = 0;
  std::optional<absl::StatusOr<CreatedBinding>> outcome;
};

BindingRegistry::BindingRegistry(ModelRegistry& models, ThreadPool& pool,
                                 const Limits& limits, BindFunction bind,
                                 Compressor::Options compression,
                                 WeightsKeeper::Options keeping)
    : limits_(limits),
      bind_(std::move(bind)),
      models_(models),
      pool_(pool),
      weights_(limits.memory, "max-bindings-memory"),
      bindings_("binding", limits.count, "max-bindings"),
      keeper_(models.store(), std::move(keeping)),
      compressor_(weights_.budget(), std::move(compression),
                  [this](const std::shared_ptr<const BindingRecord>& record) {
                    keeper_.Add(record);
                  }) {}

BindingRegistry::~BindingRegistry() {
  MutexLock lock(mutex_);
  for (const auto& [key, job] : jobs_) job->cancellation.Cancel();
  queue_.clear();
  while (running_ > 0) changed_.Wait(mutex_);
}

absl::StatusOr<std::unique_ptr<BindingRegistry::Waiter>>
BindingRegistry::Create(BindSpec spec) {
  const Key key(spec.tenant, BindingId(spec));
  return Join(key, [&]() -> absl::StatusOr<std::shared_ptr<Job>> {
    auto found = bindings_.Find(key.first, key.second);
    if (found.ok()) return MakeJobFor(*found);
    return MakeJob(key, std::move(spec));
  });
}

absl::StatusOr<std::unique_ptr<BindingRegistry::Waiter>> BindingRegistry::Join(
    const Key& key,
    absl::FunctionRef<absl::StatusOr<std::shared_ptr<Job>>()> make) {
  // Two calls that ask the same meet here: the lock is held until the job of
  // the first can be found by the second.
  MutexLock lock(mutex_);
  if (waiting_ >= limits_.waiting_calls) {
    return RetryLater(MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat(waiting_,
                     " calls wait for bindings (max-waiting-binds): try again "
                     "later"),
        {.reason = "TOO_MANY_BINDS", .field = "max-waiting-binds"}));
  }
  std::shared_ptr<Job> job;
  const auto shared = jobs_.find(key);
  if (shared != jobs_.end() && !shared->second->cancellation.cancelled()) {
    job = shared->second;
  } else {
    DEFORM_ASSIGN_OR_RETURN(job, make());
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
  DEFORM_ASSIGN_OR_RETURN(const CoordinateScheme* scheme,
                          FindScheme(spec.scheme));
  DEFORM_ASSIGN_OR_RETURN(
      auto model,
      models_.catalogue().Use(key.first, spec.model_id,
                              absl::StrCat("binding ", key.second)));
  auto job = std::make_shared<Job>(
      key, BindRequest{.model = model.record()->mesh,
                       .rig = std::move(spec.rig),
                       .scheme = std::move(spec.scheme),
                       .options = std::move(spec.options),
                       .exits = std::move(spec.exits),
                       .unbindable = spec.unbindable,
                       .clamped = std::move(spec.clamped)});
  job->points_total = job->request->model->size();
  job->model = std::move(model);
  job->known_solutions = std::move(spec.known);
  job->weight_tolerance = spec.weight_tolerance;
  DEFORM_RETURN_IF_ERROR(Reserve(*job, *scheme, "the binding needs"));
  return job;
}

absl::Status BindingRegistry::Reserve(Job& job, const CoordinateScheme& scheme,
                                      absl::string_view what) {
  const int64_t columns = ColumnsOf(job.request->rig, scheme);
  const int64_t dense = WeightTiles::BytesFor(job.points_total, columns);
  const int64_t others = SolutionBytes(job.request->rig, job.points_total) +
                         FactBytes(*job.request);
  auto memory = budget().Reserve(dense + others, what);
  if (!memory.ok() && job.weight_tolerance > 0 && compressor_.IsWorth(dense)) {
    const int64_t largest = dense / kLeastRatioAtOnce;
    auto less = budget().Reserve(
        compressor_.WorkingBytes(job.points_total, columns) + largest + others,
        what);
    if (less.ok()) {
      job.max_compressed_bytes = largest;
      memory = std::move(less);
    }
  }
  DEFORM_RETURN_IF_ERROR(memory.status());
  job.memory = *std::move(memory);
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<BindingRegistry::Job>>
BindingRegistry::MakeJobFor(const std::shared_ptr<const BindingRecord>& known) {
  auto job = std::make_shared<Job>(known);
  const BindingFacts& facts = known->facts;
  job->points_total = facts.point_count();
  if (auto binding = known->weights->Get()) {
    job->points_done = job->points_total;
    job->outcome = CreatedBinding{known, std::move(binding), true};
  }
  return job;
}

absl::StatusOr<BindingInUse> BindingRegistry::Use(const std::string& tenant,
                                                  const std::string& id,
                                                  const std::string& user,
                                                  KeepWaiting keep_waiting) {
  BindingInUse use;
  DEFORM_ASSIGN_OR_RETURN(use.lease, bindings_.Use(tenant, id, user));
  DEFORM_ASSIGN_OR_RETURN(use.binding,
                          WeightsOf(use.lease.record(), keep_waiting));
  return use;
}

absl::StatusOr<std::shared_ptr<const Binding>> BindingRegistry::WeightsOf(
    const std::shared_ptr<const BindingRecord>& record,
    KeepWaiting keep_waiting) {
  if (auto binding = record->weights->Get()) return binding;
  DEFORM_ASSIGN_OR_RETURN(const auto waiter,
                          Join(Key(record->tenant, record->id),
                               [&] { return MakeJobFor(record); }));
  for (;;) {
    if (auto outcome = waiter->Wait(kPollInterval)) {
      DEFORM_RETURN_IF_ERROR(outcome->status());
      return (*outcome)->binding;
    }
    if (!keep_waiting()) return absl::CancelledError();
  }
}

absl::Status BindingRegistry::Remove(const std::string& tenant,
                                     const std::string& id) {
  const Claims::Claim claim = claims_.Take(tenant, id);
  {
    std::shared_ptr<const BindingRecord> removed;  // Outlives the lock.
    DEFORM_ASSIGN_OR_RETURN(removed, bindings_.Remove(tenant, id, [&] {
      return store().DeleteBinding({tenant, id});
    }));
    MutexLock lock(mutex_);
    if (removed != nullptr) compressor_.Cancel(*removed);
    // Who waits for weights of a binding that is gone still gets them; who
    // creates it again gets a new one.
    const auto job = jobs_.find(Key(tenant, id));
    if (job != jobs_.end() && job->second->known == removed) jobs_.erase(job);
  }
  ReturnFreedMemory();
  return absl::OkStatus();
}

std::optional<BindProgress> BindingRegistry::ProgressOf(
    const BindingRecord& record) {
  MutexLock lock(mutex_);
  const auto job = jobs_.find(Key(record.tenant, record.id));
  if (job == jobs_.end() || job->second->known == nullptr) return std::nullopt;
  return BindProgress{job->second->points_done, job->second->points_total};
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
  if (outcome.ok()) compressor_.Add(outcome->record);
  MutexLock lock(mutex_);
  job->outcome = std::move(outcome);
  Forget(job);
  // The registry may go as soon as nothing runs, and a job holds parts of it.
  job.reset();
  --running_;
  StartJobs();
  changed_.NotifyAll();
}

absl::StatusOr<CreatedBinding> BindingRegistry::Compute(Job& job) try {
  // Whatever happens, a failed job gives the model and the memory back before
  // anyone learns of it.
  auto model = std::move(job.model);
  auto memory = std::move(job.memory);
  if (job.cancellation.cancelled()) return absl::CancelledError();
  if (job.known != nullptr) return Restore(job);
  DEFORM_ASSIGN_OR_RETURN(const auto computed, ComputeWeights(job));
  auto weights = memory.Split(computed->weight_bytes());
  DEFORM_RETURN_IF_ERROR(memory.Resize(computed->bytes(), "the binding needs"));
  const auto record = std::make_shared<const BindingRecord>(
      BindingRecord{.tenant = job.key.first,
                    .id = job.key.second,
                    .model_id = model.record()->id,
                    .weight_tolerance = job.weight_tolerance,
                    .facts = *computed,
                    .weights = weights_.MakeSlot(),
                    .create_time = TimeToStore(),
                    .memory = std::move(memory),
                    .model = std::move(model)});
  return Keep(record, record->weights->Put(computed, std::move(weights)));
} catch (const std::bad_alloc&) {
  return MakeError(absl::StatusCode::kResourceExhausted,
                   "the machine has no memory left for the computation",
                   {.reason = "OUT_OF_MEMORY", .field = "memory"});
}

absl::StatusOr<CreatedBinding> BindingRegistry::Restore(Job& job) {
  const BindingRecord& record = *job.known;
  const auto put = [&](const Binding& binding,
                       MemoryBudget::Reservation memory) {
    // The facts stay the record's: one copy, and figures that do not change.
    return CreatedBinding{
        job.known,
        record.weights->Put(binding.WithFacts(record.facts), std::move(memory)),
        true};
  };
  constexpr absl::string_view kWhat =
      "the weights of the binding, which are not in memory, need";
  if (const auto kept = keeper_.Read(record)) {
    DEFORM_ASSIGN_OR_RETURN(auto memory,
                            budget().Reserve(kept->weight_bytes(), kWhat));
    return put(*kept, std::move(memory));
  }
  DEFORM_RETURN_IF_ERROR(Reserve(job, record.facts.scheme(), kWhat));
  auto memory = std::move(job.memory);
  DEFORM_ASSIGN_OR_RETURN(const auto computed, ComputeWeights(job));
  return put(*computed, memory.Split(computed->weight_bytes()));
}

absl::StatusOr<std::shared_ptr<const Binding>> BindingRegistry::ComputeWeights(
    Job& job) const {
  BindRequest request = *job.request;
  request.weight_tolerance =
      job.max_compressed_bytes > 0 ? job.weight_tolerance : 0;
  auto computed =
      bind_(request, {.pool = &pool_,
                      .cancellation = &job.cancellation,
                      .points_done = &job.points_done,
                      .known = job.known_solutions.get(),
                      .max_weight_bytes = job.max_compressed_bytes});
  if (job.max_compressed_bytes == 0) return computed;
  if (DetailOf(computed.status()).reason == "NOT_SMALLER") {
    return NeitherFormFits(absl::StrCat(
        "compressed to a tolerance of ", job.weight_tolerance,
        " they would take more than ", FormatBytes(job.max_compressed_bytes)));
  }
  DEFORM_RETURN_IF_ERROR(computed.status());
  const double bound = (*computed)->compressed()->bound();
  if (bound <= job.weight_tolerance) return computed;
  return NeitherFormFits(
      absl::StrCat("compressed, sums in float keep them within ", bound,
                   ", not ", job.weight_tolerance));
}

void BindingRegistry::Abandon(const std::shared_ptr<Job>& job) {
  job->cancellation.Cancel();
  if (std::erase(queue_, job) > 0) Forget(job);
}

void BindingRegistry::Forget(const std::shared_ptr<Job>& job) {
  // Another may have taken its place.
  const auto found = jobs_.find(job->key);
  if (found != jobs_.end() && found->second == job) jobs_.erase(found);
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
