// The weights of bindings: kept while there is room, dropped, the longest
// unused first, when others need it.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "core/weights/binding.h"
#include "server/models/memory_budget.h"
#include "server/stores/records.h"

namespace deform::server {

// Thread-safe. Outlives its slots and all that they hand out.
class WeightsCache {
  // Memory is given back when the last who uses the weights lets go, not when
  // the slot does.
  struct Resident {
    MemoryBudget::Reservation memory;  // Goes last.
    std::shared_ptr<const Binding> binding;
  };

 public:
  // The place of one binding's weights. What is put here replaces what was: so
  // weights change their form, are dropped and come back.
  class Slot : public std::enable_shared_from_this<Slot> {
   public:
    ~Slot();
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;

    // The weights; they stay while the pointer lives. Null if they are not
    // here.
    std::shared_ptr<const Binding> Get();

    // Keeps `binding`, whose weights take `memory`, and returns it as Get()
    // does. Who uses the former weights keeps them.
    std::shared_ptr<const Binding> Put(std::shared_ptr<const Binding> binding,
                                       MemoryBudget::Reservation memory);

    // The form in which a store keeps them, as far as is known.
    void SetKept(std::optional<WeightsForm> form);
    std::optional<WeightsForm> kept() const;

    // Why the weights are not compressed, for those who asked for that.
    void StayDense(absl::string_view why);

    struct State {
      bool resident = false;
      // Of the weights, now or when they were here.
      bool compressed = false;
      double bound = 0;       // CompressedWeights::bound()
      std::string why_dense;  // Empty if they are compressed, or will be.
      int64_t bytes = 0;
      int users = 0;  // Pointers handed out; while there are any they stay.
      absl::Time last_use;  // When they were last put here, taken or let go.
    };
    State state() const;

   private:
    friend class WeightsCache;
    explicit Slot(WeightsCache& cache) : cache_(cache) {}

    std::shared_ptr<const Binding> Hand(
        const std::shared_ptr<const Resident>& resident);
    void Touch();

    WeightsCache& cache_;
    // Guarded by the cache's mutex.
    std::list<Slot*>::iterator place_;
    std::shared_ptr<const Resident> resident_;
    int64_t bytes_ = 0;
    bool compressed_ = false;
    double bound_ = 0;
    std::string why_dense_;
    std::optional<WeightsForm> kept_;
    absl::Time last_use_ = absl::InfinitePast();
  };

  WeightsCache(int64_t limit, absl::string_view option)
      : budget_(limit, option,
                [this](int64_t missing) { return Evict(missing); }) {}

  std::shared_ptr<Slot> MakeSlot();

  // Reserving evicts what nobody uses, as much as is needed.
  MemoryBudget& budget() { return budget_; }

 private:
  int64_t Evict(int64_t missing);
  // Out of their slots: as many as are missing, or none. Returns what all have.
  int64_t TakeIdle(int64_t missing,
                   std::vector<std::shared_ptr<const Resident>>& taken);

  MemoryBudget budget_;
  mutable Mutex mutex_;
  // Those that were touched last come last.
  std::list<Slot*> slots_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform::server
