#include "server/models/names.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {

std::string Printable(absl::string_view name) {
  const bool cut = name.size() > kMaxNameBytes;
  return absl::StrCat(absl::CHexEscape(name.substr(0, kMaxNameBytes)),
                      cut ? "..." : "");
}

std::string Quoted(absl::string_view name) {
  return absl::StrCat("\"", Printable(name), "\"");
}

absl::Status CheckName(absl::string_view name, absl::string_view field) {
  const bool good = !name.empty() && name.size() <= kMaxNameBytes &&
                    std::all_of(name.begin(), name.end(), [](unsigned char c) {
                      return absl::ascii_isalnum(c) || c == '_' || c == '-';
                    });
  if (good) return absl::OkStatus();
  return InvalidInput(
      "BAD_NAME", field,
      absl::StrCat(field, " ", Quoted(name), " is not 1 to ", kMaxNameBytes,
                   " of the characters A-Z a-z 0-9 _ -"));
}

absl::StatusOr<std::string> TenantOr(absl::string_view tenant) {
  if (tenant.empty()) return std::string("default");
  DEFORM_RETURN_IF_ERROR(CheckName(tenant, "tenant"));
  return std::string(tenant);
}

}  // namespace deform::server
