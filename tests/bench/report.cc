#include "tests/bench/report.h"

#include <cstdio>
#include <fstream>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace deform::bench {
namespace {

using Json = nlohmann::json;

std::string Optional(const std::optional<double>& value, const char* format) {
  if (!value) return "-";
  char text[32];
  std::snprintf(text, sizeof(text), format, *value);
  return text;
}

Json ToJson(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

}  // namespace

void PrintHeader() {
  absl::PrintF("%-72s %11s %10s %-17s %8s %8s %8s %7s\n", "name", "ms", "rate",
               "", "x naive", "x limit", "error", "MB");
}

void PrintRow(const Row& row) {
  absl::PrintF("%-72s %11.4g %10.4g %-17s %8s %8s %8s %7s\n", row.name,
               row.seconds * 1e3, row.rate, row.unit,
               Optional(row.to_naive, "%.3g"), Optional(row.to_limit, "%.2f"),
               Optional(row.error, "%.1e"), Optional(row.megabytes, "%.4g"));
  std::fflush(stdout);
}

absl::Status WriteJson(const std::vector<Row>& rows, const std::string& file) {
  Json list = Json::array();
  for (const Row& row : rows) {
    list.push_back({{"name", row.name},
                    {"seconds", row.seconds},
                    {"rate", row.rate},
                    {"unit", row.unit},
                    {"ratio_to_naive", ToJson(row.to_naive)},
                    {"ratio_to_limit", ToJson(row.to_limit)},
                    {"error", ToJson(row.error)},
                    {"megabytes", ToJson(row.megabytes)}});
  }
  std::ofstream out(file);
  out << Json{{"rows", list}}.dump(1) << "\n";
  if (!out.flush()) {
    return absl::UnavailableError(absl::StrCat("cannot write ", file));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> Compare(const std::vector<Row>& rows,
                                                 const std::string& old_file,
                                                 double tolerance) {
  std::ifstream in(old_file);
  const Json old = Json::parse(in, nullptr, false);
  if (!old.is_object() || !old.contains("rows") || !old["rows"].is_array()) {
    return absl::InvalidArgumentError(
        absl::StrCat(old_file, " is not what --json writes"));
  }
  std::vector<std::string> slower;
  absl::PrintF("\n%-72s %11s %11s %8s\n", "name", "old ms", "new ms",
               "new/old");
  for (const Json& was : old["rows"]) {
    if (!was.is_object()) continue;
    for (const Row& row : rows) {
      if (was.value("name", "") != row.name) continue;
      const double before = was.value("seconds", 0.0);
      const double ratio = row.seconds / before;
      if (ratio > 1 + tolerance) slower.push_back(row.name);
      absl::PrintF("%-72s %11.4g %11.4g %8.2f\n", row.name, before * 1e3,
                   row.seconds * 1e3, ratio);
    }
  }
  for (const std::string& name : slower) absl::PrintF("slower: %s\n", name);
  return slower;
}

}  // namespace deform::bench
