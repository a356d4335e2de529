// Errors that programs can tell apart: a status with a stable reason, the field
// of the request it is about, and, where there is one, the resource.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace deform {

// What a status says to programs. Empty strings where it does not apply.
struct ErrorDetail {
  std::string reason;         // "CAGE_NOT_CLOSED"; never changes meaning.
  std::string field;          // "rig.cage.corners".
  std::string resource_type;  // "model", "binding", "session".
  std::string resource_name;
};

// A status of `code` that says `message` to people and `detail` to programs.
absl::Status MakeError(absl::StatusCode code, absl::string_view message,
                       const ErrorDetail& detail);

// The most frequent kind: mend `field` of the request.
absl::Status InvalidInput(absl::string_view reason, absl::string_view field,
                          absl::string_view message);

// The detail of `status`; all empty if it was made without one.
ErrorDetail DetailOf(const absl::Status& status);

// `status` with `prefix` before its message and its detail kept.
absl::Status Annotate(const absl::Status& status, absl::string_view prefix);

}  // namespace deform
