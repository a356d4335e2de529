#include "client/cli/console.h"

#include <algorithm>
#include <cassert>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/exit_code.h"
#include "core/base/error.h"

namespace deform::cli {
namespace {

// Replaces what is not UTF-8 (a name of another server, say) instead of
// throwing.
std::string Dump(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

void Table::Add(std::vector<std::string> cells) {
  assert(cells.size() == columns_.size());
  rows_.push_back(std::move(cells));
}

void Table::Print(std::ostream& out) const {
  std::vector<size_t> widths;
  for (const Column& column : columns_) widths.push_back(column.title.size());
  for (const auto& row : rows_) {
    for (size_t c = 0; c < row.size(); ++c) {
      widths[c] = std::max(widths[c], row[c].size());
    }
  }
  const auto print = [&](size_t c, const std::string& cell, std::string& line) {
    const std::string padding(widths[c] - cell.size(), ' ');
    const bool right = columns_[c].align == Align::kRight;
    absl::StrAppend(&line, c == 0 ? "" : "  ", right ? padding : "", cell,
                    right ? "" : padding);
  };
  const auto finish = [&](std::string& line) {
    line.erase(line.find_last_not_of(' ') + 1);
    out << line << "\n";
  };
  std::string titles;
  for (size_t c = 0; c < columns_.size(); ++c) {
    print(c, columns_[c].title, titles);
  }
  finish(titles);
  for (const auto& row : rows_) {
    std::string line;
    for (size_t c = 0; c < row.size(); ++c) print(c, row[c], line);
    finish(line);
  }
}

void Console::Result(const Json& json,
                     absl::FunctionRef<void(std::ostream&)> human) {
  if (json_) {
    out_ << Dump(json) << "\n";
  } else {
    human(out_);
  }
  out_.flush();
}

void Console::Note(absl::string_view text) { err_ << text << std::endl; }

void Console::Error(const absl::Status& status) {
  const ErrorDetail detail = DetailOf(status);
  const std::string hint = HintFor(status);
  const std::string message(status.message());
  if (!json_) {
    err_ << "deformctl: " << message;
    if (!detail.reason.empty() && detail.reason != "USAGE") {
      err_ << " (" << detail.reason << ")";
    }
    err_ << "\n";
    if (!hint.empty()) err_ << "  next: " << hint << "\n";
    err_.flush();
    return;
  }
  Json error = {{"code", absl::StatusCodeToString(status.code())},
                {"message", message},
                {"exit_code", static_cast<int>(ExitCodeOf(status))}};
  const auto set = [&](const char* key, const std::string& value) {
    if (!value.empty()) error[key] = value;
  };
  set("reason", detail.reason);
  set("field", detail.field);
  set("resource_type", detail.resource_type);
  set("resource_name", detail.resource_name);
  set("hint", hint);
  out_ << Dump({{"error", error}}) << "\n";
  out_.flush();
}

std::string Thousands(int64_t number) {
  std::string digits = absl::StrCat(number);
  const int64_t first = digits[0] == '-' ? 1 : 0;
  for (int64_t at = static_cast<int64_t>(digits.size()) - 3; at > first;
       at -= 3) {
    digits.insert(at, 1, ',');
  }
  return digits;
}

std::string Bytes(int64_t bytes) {
  constexpr const char* kUnits[] = {"B", "kB", "MB", "GB", "TB"};
  if (bytes < 1000) return absl::StrCat(bytes, " B");
  double value = static_cast<double>(bytes);
  size_t unit = 0;
  for (; value >= 999.95 && unit + 1 < std::size(kUnits); ++unit) value /= 1000;
  return absl::StrFormat("%.1f %s", value, kUnits[unit]);
}

std::string Seconds(double seconds) {
  if (seconds < 1e-3) return absl::StrFormat("%.0f us", seconds * 1e6);
  if (seconds < 1) return absl::StrFormat("%.1f ms", seconds * 1e3);
  return absl::StrFormat("%.2f s", seconds);
}

}  // namespace deform::cli
