// Refusals of what may do later.
#pragma once

#include "absl/status/status.h"

namespace deform::server {

// `status`, with the advice to try the same again later.
absl::Status RetryLater(absl::Status status);

// Whether it bears that advice, or is Unavailable.
bool MayDoLater(const absl::Status& status);

}  // namespace deform::server
