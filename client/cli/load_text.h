// What a load run found, for people and programs.
#pragma once

#include <chrono>
#include <ostream>
#include <string>

#include "client/cli/console.h"
#include "client/load/load_run.h"

namespace deform::cli {

// What was run, as the report tells it beside the figures.
struct LoadSubject {
  LoadOptions options;
  std::string pattern;
  std::string scheme;
  int64_t models = 1;
  int64_t points = 0;  // Of a model.
  int64_t columns = 0;
  double tolerance = 0;
  std::chrono::nanoseconds p99_limit{0};  // 0: none.
};

// What makes a run fail: "" or a sentence.
std::string LoadFailure(const LoadSubject& subject, const LoadReport& report);

Json ToJson(const LoadSubject& subject, const LoadReport& report);
void Describe(const LoadSubject& subject, const LoadReport& report,
              std::ostream& out);

// One line while it runs.
std::string LiveLine(const LoadProgress& progress);
// One line of --find-limit.
std::string TrialLine(int64_t sessions, const LoadSubject& subject,
                      const LoadReport& report);

}  // namespace deform::cli
