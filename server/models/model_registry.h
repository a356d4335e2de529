// The models that clients have registered.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/mesh/mesh.h"
#include "server/models/catalogue.h"
#include "server/models/claims.h"
#include "server/models/losses.h"
#include "server/models/memory_budget.h"
#include "server/stores/store.h"

namespace deform::server {

struct ModelRecord {
  std::string tenant;
  std::string id;  // Content address.
  std::string display_name;
  std::shared_ptr<const Mesh> mesh;
  absl::Time create_time;
  MemoryBudget::Reservation memory;
};

using ModelCatalogue = Catalogue<const ModelRecord>;

// All models are in memory, and in the store before anyone learns of them.
// Thread-safe.
class ModelRegistry {
 public:
  struct Limits {
    int64_t model_bytes;  // Of one model's arrays, as uploaded.
    int64_t memory;       // Of all models.
    int64_t count;
  };

  // The store is borrowed.
  ModelRegistry(const Limits& limits, Store& store)
      : model_bytes_(limits.model_bytes),
        store_(store),
        budget_(limits.memory, "max-models-memory"),
        models_("model", limits.count, "max-models") {}

  // Brings in what the store has; nobody else uses the registry yet. What
  // cannot be read is lost, until it is registered again: DataLoss to whoever
  // asks for it. ResourceExhausted if there is more than the limits allow, and
  // what the store refuses.
  absl::StatusOr<Losses> Load(const std::vector<StoredModel>& models);

  struct Registered {
    std::shared_ptr<const ModelRecord> record;
    bool existed;
  };
  // Idempotent by content. ResourceExhausted if there is no room, in memory or
  // in the store; what the store refuses. Then there is nothing.
  absl::StatusOr<Registered> Register(const std::string& tenant,
                                      const std::string& display_name,
                                      Mesh mesh);

  // NotFound; FailedPrecondition MODEL_IN_USE; what the store refuses: then it
  // stays.
  absl::Status Remove(const std::string& tenant, const std::string& id);

  int64_t max_model_bytes() const { return model_bytes_; }
  MemoryBudget& budget() { return budget_; }
  // To look things up and use them; Remove() is here.
  ModelCatalogue& catalogue() { return models_; }
  Store& store() { return store_; }

 private:
  absl::Status LoadOne(const StoredModel& model);

  const int64_t model_bytes_;
  Store& store_;
  MemoryBudget budget_;
  ModelCatalogue models_;
  Claims claims_;
};

}  // namespace deform::server
