#include "server/models/weights_cache.h"

#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "server/models/process_memory.h"

namespace deform::server {

std::shared_ptr<WeightsCache::Slot> WeightsCache::MakeSlot() {
  std::shared_ptr<Slot> slot(new Slot(*this));
  slot->last_use_ = absl::Now();  // Weights may be in the store only.
  MutexLock lock(mutex_);
  slot->place_ = slots_.insert(slots_.end(), slot.get());
  return slot;
}

int64_t WeightsCache::Evict(int64_t missing) {
  std::vector<std::shared_ptr<const Resident>> dropped;
  const int64_t idle = TakeIdle(missing, dropped);
  if (dropped.empty()) return idle;
  dropped.clear();
  ReturnFreedMemory();
  return idle;
}

int64_t WeightsCache::TakeIdle(
    int64_t missing, std::vector<std::shared_ptr<const Resident>>& taken) {
  int64_t idle = 0;
  MutexLock lock(mutex_);
  // Others get pointers only from the slot, under this lock: who holds the only
  // one here keeps it.
  const auto is_idle = [](const Slot& slot) {
    return slot.resident_ != nullptr && slot.resident_.use_count() == 1;
  };
  for (const Slot* slot : slots_) {
    if (is_idle(*slot)) idle += slot->resident_->memory.bytes();
  }
  if (idle < missing) return idle;
  for (Slot* slot : slots_) {
    if (missing <= 0) break;
    if (!is_idle(*slot)) continue;
    missing -= slot->resident_->memory.bytes();
    taken.push_back(std::move(slot->resident_));
  }
  return idle;
}

WeightsCache::Slot::~Slot() {
  MutexLock lock(cache_.mutex_);
  cache_.slots_.erase(place_);
}

std::shared_ptr<const Binding> WeightsCache::Slot::Get() {
  std::shared_ptr<const Resident> resident;
  {
    MutexLock lock(cache_.mutex_);
    resident = resident_;
  }
  if (resident == nullptr) return nullptr;
  Touch();
  return Hand(resident);
}

std::shared_ptr<const Binding> WeightsCache::Slot::Put(
    std::shared_ptr<const Binding> binding, MemoryBudget::Reservation memory) {
  std::shared_ptr<const Resident> resident = std::make_shared<const Resident>(
      Resident{std::move(memory), std::move(binding)});
  std::shared_ptr<const Resident> former = resident;
  {
    MutexLock lock(cache_.mutex_);
    std::swap(resident_, former);
    bytes_ = resident->memory.bytes();
    const CompressedWeights* compressed = resident->binding->compressed();
    compressed_ = compressed != nullptr;
    bound_ = compressed_ ? compressed->bound() : 0;
    if (compressed_) why_dense_.clear();
  }
  Touch();
  return Hand(resident);
}

std::shared_ptr<const Binding> WeightsCache::Slot::Hand(
    const std::shared_ptr<const Resident>& resident) {
  // Letting go is a use too: what has been idle for longest goes first.
  return {resident->binding.get(),
          [held = resident, slot = weak_from_this()](const Binding*) mutable {
            held.reset();
            if (const auto self = slot.lock()) self->Touch();
          }};
}

void WeightsCache::Slot::Touch() {
  MutexLock lock(cache_.mutex_);
  last_use_ = absl::Now();
  cache_.slots_.splice(cache_.slots_.end(), cache_.slots_, place_);
}

void WeightsCache::Slot::SetKept(std::optional<WeightsForm> form) {
  MutexLock lock(cache_.mutex_);
  kept_ = std::move(form);
}

std::optional<WeightsForm> WeightsCache::Slot::kept() const {
  MutexLock lock(cache_.mutex_);
  return kept_;
}

void WeightsCache::Slot::StayDense(absl::string_view why) {
  MutexLock lock(cache_.mutex_);
  why_dense_ = std::string(why);
}

WeightsCache::Slot::State WeightsCache::Slot::state() const {
  MutexLock lock(cache_.mutex_);
  return {.resident = resident_ != nullptr,
          .compressed = compressed_,
          .bound = bound_,
          .why_dense = why_dense_,
          .bytes = bytes_,
          .users = resident_ == nullptr
                       ? 0
                       : static_cast<int>(resident_.use_count()) - 1,
          .last_use = last_use_};
}

}  // namespace deform::server
