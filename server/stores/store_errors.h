// What stores say alike.
#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "server/stores/records.h"

namespace deform::server {

// InvalidArgument BAD_STORE_KEY.
absl::Status CheckKey(const StoreKey& key);
absl::Status CheckForm(const WeightsForm& form);
// InvalidArgument BAD_EPOCH.
absl::Status CheckEpoch(uint64_t epoch);

// NotFound MODEL_NOT_FOUND, BINDING_NOT_FOUND, SESSION_NOT_FOUND.
absl::Status NotStored(absl::string_view type, const StoreKey& key);
// NotFound WEIGHTS_NOT_STORED.
absl::Status WeightsNotStored(const StoreKey& binding);
// AlreadyExists SESSION_EXISTS.
absl::Status SessionExists(const StoreKey& session);
// DataLoss ENTRY_DAMAGED.
absl::Status EntryDamaged(absl::string_view type, const StoreKey& key);

}  // namespace deform::server
