// The rows of a store as sealed bytes. Keys stand in columns beside them and
// are sealed in, too.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "server/stores/records.h"

namespace deform::server {

std::string Encode(const StoredModel& model);
std::string Encode(const StoredBinding& binding);
std::string Encode(const StoredSession& session);
std::string Encode(const WeightsForm& form, const StoreKey& binding);

// Nothing if they are not what was written under this key.
std::optional<StoredModel> DecodeModel(const StoreKey& key,
                                       std::span<const std::byte> bytes);
std::optional<StoredBinding> DecodeBinding(const StoreKey& key,
                                           std::span<const std::byte> bytes);
std::optional<StoredSession> DecodeSession(const StoreKey& key,
                                           std::span<const std::byte> bytes);
std::optional<WeightsForm> DecodeForm(const StoreKey& binding,
                                      std::span<const std::byte> bytes);

}  // namespace deform::server
