#include "server/stores/store_errors.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {
namespace {

absl::Status CheckPart(absl::string_view part, size_t max_bytes) {
  const bool right =
      !part.empty() && part.size() <= max_bytes &&
      std::all_of(part.begin(), part.end(), [](char c) {
        return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' ||
               c == '-';
      });
  if (right) return absl::OkStatus();
  return InvalidInput(
      "BAD_STORE_KEY", "key",
      absl::StrCat("\"", absl::CHexEscape(part.substr(0, max_bytes)),
                   "\" is not 1 to ", max_bytes, " of [A-Za-z0-9_-]"));
}

absl::Status Error(absl::StatusCode code, absl::string_view reason,
                   absl::string_view type, const StoreKey& key,
                   absl::string_view message) {
  return MakeError(code, message,
                   {.reason = std::string(reason),
                    .resource_type = std::string(type),
                    .resource_name = key.id});
}

}  // namespace

absl::Status CheckKey(const StoreKey& key) {
  DEFORM_RETURN_IF_ERROR(CheckPart(key.tenant, 64));
  return CheckPart(key.id, 64);
}

absl::Status CheckForm(const WeightsForm& form) {
  return CheckPart(form.name, 32);
}

absl::Status CheckEpoch(uint64_t epoch) {
  if (epoch > 0) return absl::OkStatus();
  return InvalidInput("BAD_EPOCH", "epoch", "epochs begin with 1");
}

absl::Status NotStored(absl::string_view type, const StoreKey& key) {
  return Error(absl::StatusCode::kNotFound,
               absl::StrCat(absl::AsciiStrToUpper(type), "_NOT_FOUND"), type,
               key, absl::StrCat("no ", type, " \"", key.id, "\""));
}

absl::Status WeightsNotStored(const StoreKey& binding) {
  return Error(
      absl::StatusCode::kNotFound, "WEIGHTS_NOT_STORED", "binding", binding,
      absl::StrCat("no weights of binding \"", binding.id, "\" are stored"));
}

absl::Status SessionExists(const StoreKey& session) {
  return Error(absl::StatusCode::kAlreadyExists, "SESSION_EXISTS", "session",
               session,
               absl::StrCat("there is a session \"", session.id, "\" already"));
}

absl::Status EntryDamaged(absl::string_view type, const StoreKey& key) {
  return Error(
      absl::StatusCode::kDataLoss, "ENTRY_DAMAGED", type, key,
      absl::StrCat("what is stored of ", type, " \"", key.id, "\" of tenant \"",
                   key.tenant, "\" is not what was written"));
}

}  // namespace deform::server
