#include "server/models/losses.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform::server {

absl::Status Damaged(absl::string_view type, const std::string& id,
                     const absl::Status& cause, absl::string_view remedy) {
  return MakeError(
      absl::StatusCode::kDataLoss,
      absl::StrCat("what was stored of ", type, " \"", id,
                   "\" is damaged: ", remedy, " (", cause.message(), ")"),
      {.reason = absl::StrCat(absl::AsciiStrToUpper(type), "_DAMAGED"),
       .resource_type = std::string(type),
       .resource_name = id});
}

}  // namespace deform::server
