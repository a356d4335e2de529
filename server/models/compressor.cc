#include "server/models/compressor.h"

#include <new>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/compress_weights.h"
#include "server/models/process_memory.h"

namespace deform::server {
namespace {

absl::Status StayDense(absl::string_view why) {
  return absl::FailedPreconditionError(why);
}

// What is needed of a record: a binding that is removed meanwhile lets its
// model go at once.
BindingRecord WithoutLease(const BindingRecord& record) {
  return {.tenant = record.tenant,
          .id = record.id,
          .model_id = record.model_id,
          .weight_tolerance = record.weight_tolerance,
          .facts = record.facts,
          .weights = record.weights,
          .create_time = record.create_time,
          .memory = {},
          .model = {}};
}

std::string TooSmall(int64_t dense_bytes) {
  return absl::StrCat("they are small: ", FormatBytes(dense_bytes),
                      " lie in the processor's caches");
}

}  // namespace

Compressor::Compressor(MemoryBudget& budget, Options options, Settled settled)
    : budget_(budget),
      options_(std::move(options)),
      settled_(std::move(settled)) {}

Compressor::~Compressor() {
  Stop();
  MutexLock lock(mutex_);
  while (running_) changed_.Wait(mutex_);
}

void Compressor::Add(const std::shared_ptr<const BindingRecord>& record) {
  if (record->weight_tolerance == 0 || !options_.executor ||
      record->weights->state().compressed) {
    return Settle(record);
  }
  const BindingFacts& facts = record->facts;
  const int64_t dense_bytes =
      WeightTiles::BytesFor(facts.point_count(), facts.column_count());
  if (!options_.is_worth(dense_bytes)) {
    record->weights->StayDense(TooSmall(dense_bytes));
    return Settle(record);
  }
  MutexLock lock(mutex_);
  if (stopped_ || Find(*record) != nullptr) return;
  record->weights->StayDense("");
  auto task = std::make_shared<Task>();
  task->record = record;
  task->key = record.get();
  task->points_total = facts.point_count();
  tasks_.push_back(std::move(task));
  if (!running_) Start();
}

void Compressor::Cancel(const BindingRecord& record) {
  MutexLock lock(mutex_);
  const auto task = Find(record);
  if (task == nullptr) return;
  task->cancellation.Cancel();
  // The one that runs ends by itself.
  if (!running_ || task != tasks_.front()) std::erase(tasks_, task);
}

void Compressor::Stop() {
  MutexLock lock(mutex_);
  stopped_ = true;
  for (const auto& task : tasks_) task->cancellation.Cancel();
}

void Compressor::SetListener(Listener listener) {
  MutexLock lock(listener_mutex_);
  listener_ = std::move(listener);
}

std::optional<BindProgress> Compressor::ProgressOf(
    const BindingRecord& record) const {
  MutexLock lock(mutex_);
  const auto task = Find(record);
  if (task == nullptr) return std::nullopt;
  return BindProgress{task->points_done, task->points_total};
}

int64_t Compressor::WorkingBytes(int64_t points, int64_t columns) const {
  const int threads = options_.pool == nullptr ? 1 : options_.pool->threads();
  return CompressionBytes(points, columns, threads);
}

std::shared_ptr<Compressor::Task> Compressor::Find(
    const BindingRecord& record) const {
  for (const auto& task : tasks_) {
    if (task->key == &record && !task->cancellation.cancelled()) return task;
  }
  return nullptr;
}

void Compressor::Start() {
  running_ = true;
  options_.executor([this] { Work(); });
}

void Compressor::Work() {
  std::shared_ptr<Task> task;
  {
    MutexLock lock(mutex_);
    task = tasks_.front();
  }
  Run(*task);
  MutexLock lock(mutex_);
  std::erase(tasks_, task);
  if (tasks_.empty()) {
    running_ = false;
    changed_.NotifyAll();
  } else {
    Start();
  }
}

void Compressor::Run(Task& task) {
  std::optional<BindingRecord> record;
  if (const auto kept = task.record.lock()) record.emplace(WithoutLease(*kept));
  if (!record || task.cancellation.cancelled()) return;
  const absl::Status replaced = Replace(*record, task);
  ReturnFreedMemory();
  if (replaced.ok()) {
    MutexLock lock(listener_mutex_);
    if (listener_) listener_(*record);
  } else {
    record->weights->StayDense(replaced.message());
  }
  const auto kept = task.record.lock();
  if (kept != nullptr && !task.cancellation.cancelled()) Settle(kept);
}

absl::Status Compressor::Replace(const BindingRecord& record, Task& task) try {
  // While it is here, the dense form is not evicted.
  const auto dense = record.weights->Get();
  if (dense == nullptr || dense->compressed() != nullptr) {
    return StayDense("");  // Evicted: again when they are computed again.
  }
  const int64_t largest = dense->weights().bytes() / kLeastRatio;
  const int64_t solutions = dense->weight_bytes() - dense->weights().bytes();
  DEFORM_ASSIGN_OR_RETURN(auto memory,
                          budget_.Reserve(WorkingBytes(dense->point_count(),
                                                       dense->column_count()) +
                                              largest + solutions,
                                          "compressing the weights needs"));
  const auto made = options_.compress(*dense, record.weight_tolerance,
                                      {.pool = options_.pool,
                                       .cancellation = &task.cancellation,
                                       .points_done = &task.points_done,
                                       .max_weight_bytes = largest});
  if (task.cancellation.cancelled()) return StayDense("");
  if (DetailOf(made.status()).reason == "NOT_SMALLER") {
    return StayDense(absl::StrCat("compressed they would take more than ",
                                  FormatBytes(largest)));
  }
  DEFORM_RETURN_IF_ERROR(made.status());
  const double bound = (*made)->compressed()->bound();
  if (bound > record.weight_tolerance) {
    return StayDense(absl::StrCat("sums in float keep them within ", bound,
                                  ", not ", record.weight_tolerance));
  }
  record.weights->Put((*made)->WithFacts(record.facts),
                      memory.Split((*made)->weight_bytes()));
  return absl::OkStatus();
} catch (const std::bad_alloc&) {
  return StayDense("the machine has no memory left to compress them");
}

}  // namespace deform::server
