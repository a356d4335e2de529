// Names that come from outside.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace deform::server {

inline constexpr int kMaxNameBytes = 64;
inline constexpr int kMaxDisplayNameBytes = 256;

// A name from outside as it may be told to others: cut, and escaped to ASCII.
std::string Printable(absl::string_view name);
// The same in quotes, for messages.
std::string Quoted(absl::string_view name);

// InvalidArgument BAD_NAME, about `field`, unless `name` is 1 to 64 of
// [A-Za-z0-9_-].
absl::Status CheckName(absl::string_view name, absl::string_view field);

// "default" for an empty one; otherwise checked.
absl::StatusOr<std::string> TenantOr(absl::string_view tenant);

}  // namespace deform::server
