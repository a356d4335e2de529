// Takes a directory of reference cases through a live server.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/client.h"
#include "client/verify/judge.h"

namespace deform {

struct VerifyOptions {
  std::string directory;
  std::string group_prefix;  // Only cases of these groups.
  int cases_at_a_time = 4;
  // Set from a signal handler to end early; what was made is deleted still.
  const std::atomic<bool>* interrupted = nullptr;
  ProgressCallback progress;
};

struct VerifyOutcome {
  VerifyReport report;
  std::vector<std::string> skipped;  // JSON objects of another schema.
  // Something could not be deleted from the server.
  absl::Status cleanup;
  bool ok() const { return report.failures.empty(); }
};

// Runs all cases of *.json in the directory. Files that cannot be read as a
// case, and cases that cannot be run, are failures of the report. Errors:
//   NotFound (NO_CASES)  the directory cannot be read, or holds no case of the
//                        groups asked for
//   Cancelled            interrupted
//   the error of ListSchemes: the server cannot be reached
absl::StatusOr<VerifyOutcome> Verify(Client& client,
                                     const VerifyOptions& options);

}  // namespace deform
