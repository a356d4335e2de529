// What was measured: as a table, as JSON, and against an older run.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace deform::bench {

struct Row {
  std::string name;    // "deform 173K x 326/this, dense, 1 core"
  double seconds = 0;  // The best of all rounds, of one.
  double rate = 0;     // Per second, of `unit`.
  std::string unit;
  // Where it applies: how many times as fast as the plain way; the share of
  // what is possible (the memory's read speed; of a delta, its share of the
  // columns times the dense pass); the largest error, in units of D or of a
  // weight; and what the weights take.
  std::optional<double> to_naive;
  std::optional<double> to_limit;
  std::optional<double> error;
  std::optional<double> megabytes;
};

struct Settings {
  bool quick = false;
  double scale = 1;    // Of all counts of points: below 1 to try the program.
  std::string filter;  // Only scenes whose name contains it.

  bool Wants(const std::string& scene) const {
    return scene.find(filter) != std::string::npos;
  }
  // How long a contest runs that takes so long in full.
  double Seconds(double full) const {
    return scale * (quick ? 0.25 * full : full);
  }
  int64_t Points(int64_t points) const {
    return std::max<int64_t>(100, static_cast<int64_t>(scale * points));
  }
};

void PrintHeader();
void PrintRow(const Row& row);

// Unavailable if the file cannot be written.
absl::Status WriteJson(const std::vector<Row>& rows, const std::string& file);

// Prints the rows that both runs have, and those slower by more than
// `tolerance` (0.3: by 30 %) once more. Returns the names of these.
// InvalidArgument if the file is none that WriteJson() wrote.
absl::StatusOr<std::vector<std::string>> Compare(const std::vector<Row>& rows,
                                                 const std::string& old_file,
                                                 double tolerance);

}  // namespace deform::bench
