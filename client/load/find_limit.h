// How many sessions a server carries.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"

namespace deform {

struct LimitSearch {
  int64_t first = 1;  // Sessions of the first trial.
  int64_t most = 4096;
  // Ends when the limit is known to this part of itself, or to one session.
  double resolution = 0.05;
};

struct FoundLimit {
  int64_t holds = 0;  // The most sessions of a trial that held; 0: none.
  int64_t fails = 0;  // The least of one that did not; 0: none.
};

// `trial` says whether so many sessions hold. Doubles from the first trial on
// until one fails (halves, if the first fails), then halves what is left
// between: at most about 30 trials. An error of a trial ends the search.
absl::StatusOr<FoundLimit> FindLimit(
    const LimitSearch& search,
    absl::FunctionRef<absl::StatusOr<bool>(int64_t sessions)> trial);

}  // namespace deform
