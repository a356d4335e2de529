// Durations as people write them.
#pragma once

#include <chrono>
#include <string>

#include "absl/status/statusor.h"

namespace deform::cli {

// "20s", "500ms", "2m", "1m30s". A usage error that names `option` for anything
// else, and for what is not from `least` to `most`, both of the same kind.
absl::StatusOr<std::chrono::nanoseconds> ParseDuration(
    const std::string& option, const std::string& text,
    const std::string& least, const std::string& most);

}  // namespace deform::cli
