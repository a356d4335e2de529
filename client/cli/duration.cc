#include "client/cli/duration.h"

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "client/cli/exit_code.h"

namespace deform::cli {

absl::StatusOr<std::chrono::nanoseconds> ParseDuration(
    const std::string& option, const std::string& text,
    const std::string& least, const std::string& most) {
  absl::Duration value, low, high;
  absl::ParseDuration(least, &low);
  absl::ParseDuration(most, &high);
  if (!absl::ParseDuration(text, &value)) {
    return UsageError(absl::StrCat(option, ": '", text,
                                   "' is not a duration, such as 20s, 500ms or "
                                   "2m"));
  }
  if (value < low || value > high) {
    return UsageError(absl::StrCat(option, ": ", text, " is not between ",
                                   least, " and ", most));
  }
  return absl::ToChronoNanoseconds(value);
}

}  // namespace deform::cli
