// What was stored and cannot be had.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace deform::server {

// DataLoss, each naming what and why.
using Losses = std::vector<absl::Status>;

// DataLoss <TYPE>_DAMAGED because of `cause`, saying what helps.
absl::Status Damaged(absl::string_view type, const std::string& id,
                     const absl::Status& cause, absl::string_view remedy);

}  // namespace deform::server
