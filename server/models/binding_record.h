// A binding that is kept.
#pragma once

#include <memory>
#include <string>

#include "absl/time/time.h"
#include "core/weights/binding.h"
#include "server/models/memory_budget.h"
#include "server/models/model_registry.h"
#include "server/models/weights_cache.h"

namespace deform::server {

struct BindingRecord {
  std::string tenant;
  std::string id;  // Content address of the whole BindSpec.
  std::string model_id;
  double weight_tolerance = 0;  // To which weights are compressed; 0: dense.
  BindingFacts facts;
  std::shared_ptr<WeightsCache::Slot> weights;  // Where they are, if they are.
  absl::Time create_time;
  MemoryBudget::Reservation memory;  // Of the facts.
  ModelCatalogue::Lease model;       // The model stays while its binding does.
};

}  // namespace deform::server
