// Models, bindings and sessions by their ids alone.
#pragma once

#include <string>
#include <variant>

#include "absl/status/statusor.h"
#include "client/cpp/client.h"

namespace deform::cli {

using Thing = std::variant<ModelInfo, BindingInfo, SessionInfo>;

// NotFound (ID_NOT_FOUND) if the server has neither under this id.
absl::StatusOr<Thing> FindThing(Client& client, const std::string& id);

// "model", "binding" or "session".
const char* KindOf(const Thing& thing);

absl::Status DeleteThing(Client& client, const Thing& thing);

}  // namespace deform::cli
