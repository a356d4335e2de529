#include "client/load/find_limit.h"

#include <algorithm>

#include "core/base/status_macros.h"

namespace deform {

absl::StatusOr<FoundLimit> FindLimit(
    const LimitSearch& search,
    absl::FunctionRef<absl::StatusOr<bool>(int64_t sessions)> trial) {
  FoundLimit found;
  int64_t next = std::clamp<int64_t>(search.first, 1, search.most);
  while (true) {
    DEFORM_ASSIGN_OR_RETURN(const bool holds, trial(next));
    (holds ? found.holds : found.fails) = next;
    const int64_t gap = found.fails - found.holds;
    if (found.fails == 0) {
      if (found.holds == search.most) return found;
      next = std::min(2 * found.holds, search.most);
    } else if (gap <= 1 ||
               static_cast<double>(gap) <=
                   search.resolution * static_cast<double>(found.holds)) {
      return found;
    } else {
      // Between them; from 0 on by halves.
      next = found.holds + gap / 2;
    }
  }
}

}  // namespace deform
