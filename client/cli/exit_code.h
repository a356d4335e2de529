// How deformctl ends, and what it advises.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace deform::cli {

// Part of the command's contract with scripts; also told by --help.
enum ExitCode {
  kOk = 0,
  kCheckFailed = 1,   // verify found something wrong.
  kUsage = 2,         // Bad arguments.
  kBadFile = 3,       // A file cannot be read, understood or written.
  kRefused = 4,       // The server said no.
  kUnreachable = 5,   // No server answers, or the connection broke.
  kInterrupted = 130  // Ctrl-C, as shells count it.
};

// `status`, which is an error, with the code that deformctl shall end with.
absl::Status WithExit(ExitCode code, const absl::Status& status);

// The code given above; otherwise kUnreachable for a broken connection,
// kInterrupted for Cancelled, else kRefused: errors come from the server unless
// somebody says they do not.
ExitCode ExitCodeOf(const absl::Status& status);

absl::Status UsageError(absl::string_view message);

// What to do next, by the reason of the error; empty if there is nothing to say
// that the message does not.
std::string HintFor(const absl::Status& status);

}  // namespace deform::cli
