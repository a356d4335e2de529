#include "server/models/weights_keeper.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "server/models/weight_arrays.h"

namespace deform::server {

WeightsKeeper::WeightsKeeper(Store& store, Options options)
    : store_(store), options_(std::move(options)) {}

WeightsKeeper::~WeightsKeeper() {
  MutexLock lock(mutex_);
  waiting_.clear();
  while (running_) changed_.Wait(mutex_);
}

void WeightsKeeper::Add(const std::shared_ptr<const BindingRecord>& record) {
  if (!options_.executor) return;
  MutexLock lock(mutex_);
  waiting_.push_back(record);
  if (running_) return;
  running_ = true;
  options_.executor([this] { Work(); });
}

void WeightsKeeper::Work() {
  while (true) {
    std::weak_ptr<const BindingRecord> next;
    {
      MutexLock lock(mutex_);
      if (waiting_.empty()) {
        running_ = false;
        changed_.NotifyAll();
        return;
      }
      next = std::move(waiting_.front());
      waiting_.pop_front();
    }
    Keep(next);
  }
}

void WeightsKeeper::Keep(const std::weak_ptr<const BindingRecord>& waiting) {
  auto record = waiting.lock();
  if (record == nullptr) return;
  const StoreKey key{record->tenant, record->id};
  const auto slot = record->weights;
  record.reset();  // Who removes the binding need not wait for the disk.
  const auto binding = slot->Get();
  // Evicted: again when they are computed again.
  if (binding == nullptr) return;
  const WeightsForm form = FormOf(*binding);
  if (slot->kept() == form) return;
  const absl::Status put = store_.PutWeights(key, form, ArraysOf(binding));
  if (put.ok()) {
    slot->SetKept(form);
  } else if (!absl::IsNotFound(put) && options_.report) {
    options_.report(Annotate(
        put, absl::StrCat("the weights of binding ", key.id,
                          " are not kept, and would be computed again: ")));
  }
}

std::shared_ptr<const Binding> WeightsKeeper::Read(
    const BindingRecord& record) {
  const auto stored = store_.Weights({record.tenant, record.id});
  absl::Status status = stored.status();
  if (status.ok()) {
    auto binding = BindingFrom(record.facts, *stored);
    if (binding.ok()) {
      record.weights->SetKept(stored->form);
      return *std::move(binding);
    }
    status = binding.status();
  }
  record.weights->SetKept(std::nullopt);
  if (!absl::IsNotFound(status) && options_.report) {
    options_.report(
        Annotate(status, absl::StrCat("the weights of binding ", record.id,
                                      " are computed again: ")));
  }
  return nullptr;
}

}  // namespace deform::server
