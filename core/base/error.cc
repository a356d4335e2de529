#include "core/base/error.h"

#include <vector>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace deform {
namespace {

// Fields of the payload are separated by a byte that occurs in none of them.
constexpr char kSeparator = '\x1f';
constexpr char kPayload[] = "deformd/error-detail";

}  // namespace

absl::Status MakeError(absl::StatusCode code, absl::string_view message,
                       const ErrorDetail& detail) {
  absl::Status status(code, message);
  status.SetPayload(kPayload, absl::Cord(absl::StrJoin(
                                  {detail.reason, detail.field,
                                   detail.resource_type, detail.resource_name},
                                  std::string(1, kSeparator))));
  return status;
}

absl::Status InvalidInput(absl::string_view reason, absl::string_view field,
                          absl::string_view message) {
  return MakeError(
      absl::StatusCode::kInvalidArgument, message,
      {.reason = std::string(reason), .field = std::string(field)});
}

ErrorDetail DetailOf(const absl::Status& status) {
  const auto payload = status.GetPayload(kPayload);
  if (!payload) return {};
  const std::string text(*payload);
  std::vector<std::string> parts = absl::StrSplit(text, kSeparator);
  parts.resize(4);
  return {parts[0], parts[1], parts[2], parts[3]};
}

absl::Status Annotate(const absl::Status& status, absl::string_view prefix) {
  if (status.ok()) return status;
  absl::Status annotated(status.code(), absl::StrCat(prefix, status.message()));
  status.ForEachPayload([&](absl::string_view url, const absl::Cord& payload) {
    annotated.SetPayload(url, payload);
  });
  return annotated;
}

}  // namespace deform
