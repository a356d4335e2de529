// What deformctl says, to people or to programs.
#pragma once

#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace deform::cli {

// Keeps the order in which fields were set.
using Json = nlohmann::ordered_json;

// Rows of text in columns that line up; numbers to the right.
class Table {
 public:
  enum class Align { kLeft, kRight };
  struct Column {
    std::string title;
    Align align = Align::kLeft;
  };

  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}
  // `cells`: one per column.
  void Add(std::vector<std::string> cells);
  bool empty() const { return rows_.empty(); }
  void Print(std::ostream& out) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// Not thread-safe. Streams are borrowed.
class Console {
 public:
  // `terminal`: whether `err` is one, and may be redrawn.
  Console(std::ostream& out, std::ostream& err, bool json, bool terminal)
      : out_(out), err_(err), json_(json), terminal_(terminal) {}

  bool json() const { return json_; }
  bool terminal() const { return terminal_; }
  std::ostream& out() { return out_; }
  std::ostream& err() { return err_; }

  // The result of a command: `json`, or what `human` writes.
  void Result(const Json& json, absl::FunctionRef<void(std::ostream&)> human);
  // Something on the side, for people: to the error stream.
  void Note(absl::string_view text);
  // Message, reason and hint of an error; with --json as the object "error" on
  // the output stream.
  void Error(const absl::Status& status);

 private:
  std::ostream& out_;
  std::ostream& err_;
  const bool json_;
  const bool terminal_;
};

// For people: "1,234,567", "225.0 MB", "12.3 ms".
std::string Thousands(int64_t number);
std::string Bytes(int64_t bytes);
std::string Seconds(double seconds);

}  // namespace deform::cli
