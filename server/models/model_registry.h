// The models that clients have registered.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/mesh/mesh.h"
#include "server/models/catalogue.h"
#include "server/models/memory_budget.h"

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

// Thread-safe.
class ModelRegistry {
 public:
  struct Limits {
    int64_t model_bytes;  // Of one model's arrays, as uploaded.
    int64_t memory;       // Of all models.
    int64_t count;
  };

  explicit ModelRegistry(const Limits& limits)
      : model_bytes_(limits.model_bytes),
        budget_(limits.memory, "max-models-memory"),
        models_("model", limits.count, "max-models") {}

  struct Registered {
    std::shared_ptr<const ModelRecord> record;
    bool existed;
  };
  // Idempotent by content. ResourceExhausted if there is no room.
  absl::StatusOr<Registered> Register(const std::string& tenant,
                                      const std::string& display_name,
                                      Mesh mesh);

  int64_t max_model_bytes() const { return model_bytes_; }
  MemoryBudget& budget() { return budget_; }
  ModelCatalogue& catalogue() { return models_; }

 private:
  const int64_t model_bytes_;
  MemoryBudget budget_;
  ModelCatalogue models_;
};

}  // namespace deform::server
