// A session's binding replaced by one of edited handles.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/deform/pose_transfer.h"
#include "server/models/binding_registry.h"
#include "server/models/memory_budget.h"

namespace deform::server {

// What happened, as participants are told. Immutable; travels as
// shared_ptr<const RigChange>.
struct RigChange {
  std::string binding_id;
  int dimension = 3;
  PoseTransfer transfer;
  uint64_t revision = 0;  // The first on the new rig.
  // How far the change moved any point of the model, in units of the new rig's
  // diagonal.
  double largest_jump = 0;
};

struct RigMoved {
  uint64_t revision = 0;
  double largest_jump = 0;
};

// What a session needs to change over.
struct RigMove {
  std::string from;  // The binding that it must have then.
  BindingInUse to;
  MemoryBudget::Reservation memory;
  std::vector<int32_t> previous;  // As in EditedHandles.
  // Told once how it ended, on any thread, with no lock of the session held.
  // FailedPrecondition OTHER_BINDING if the session has another by then.
  std::function<void(const absl::StatusOr<RigMoved>&)> done;
};

}  // namespace deform::server
