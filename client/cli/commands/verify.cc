// deformctl verify: reference cases through a live server.
#include "client/verify/verify.h"

#include <CLI/CLI.hpp>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/progress.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  std::string directory;
  std::string group;
  int jobs = 4;
};

Json ToJson(const VerifyOutcome& outcome) {
  Json groups = Json::array();
  for (const auto& [name, group] : outcome.report.groups) {
    groups.push_back({{"group", name},
                      {"cases", group.cases},
                      {"queries", group.queries},
                      {"errors_as_expected", group.errors_as_expected},
                      {"errors_named_otherwise", group.errors_named_otherwise},
                      {"weight_error", group.weight_error},
                      {"psi_error", group.psi_error},
                      {"reproduction_error", group.reproduction_error},
                      {"deformed_error", group.deformed_error},
                      {"streamed_error", group.streamed_error},
                      {"worst_ratio", group.worst_ratio},
                      {"failures", group.failures}});
  }
  Json failures = Json::array();
  for (const VerifyFailure& failure : outcome.report.failures) {
    Json entry = {{"group", failure.group}, {"case", failure.case_id}};
    if (failure.query >= 0) entry["query"] = failure.query;
    entry["message"] = failure.message;
    if (!failure.tags.empty()) entry["tags"] = failure.tags;
    failures.push_back(std::move(entry));
  }
  return {{"ok", outcome.ok()},
          {"groups", groups},
          {"failures", failures},
          {"skipped_files", outcome.skipped}};
}

Table GroupTable(const VerifyReport& report) {
  constexpr auto kRight = Table::Align::kRight;
  Table table({{"GROUP"},
               {"CASES", kRight},
               {"QUERIES", kRight},
               {"ERRORS OK", kRight},
               {"WEIGHTS", kRight},
               {"PSI", kRight},
               {"REPRODUCED", kRight},
               {"DEFORMED", kRight},
               {"STREAMED", kRight},
               {"ERROR/TOL", kRight},
               {"FAILURES", kRight}});
  const auto error = [](double value) {
    return value == 0 ? std::string("0") : absl::StrFormat("%.1e", value);
  };
  for (const auto& [name, group] : report.groups) {
    table.Add({name, absl::StrCat(group.cases), absl::StrCat(group.queries),
               absl::StrCat(group.errors_as_expected),
               error(group.weight_error), error(group.psi_error),
               error(group.reproduction_error), error(group.deformed_error),
               error(group.streamed_error),
               absl::StrFormat("%.2g", group.worst_ratio),
               absl::StrCat(group.failures)});
  }
  return table;
}

void PrintFailures(const VerifyReport& report, std::ostream& out) {
  constexpr size_t kShown = 50;
  for (size_t i = 0; i < report.failures.size() && i < kShown; ++i) {
    const VerifyFailure& failure = report.failures[i];
    out << "FAIL " << failure.case_id;
    if (failure.query >= 0) out << " query " << failure.query;
    out << ": " << failure.message;
    if (!failure.tags.empty()) {
      out << " [" << absl::StrJoin(failure.tags, ", ") << "]";
    }
    out << "\n";
  }
  if (report.failures.size() > kShown) {
    out << "... and " << report.failures.size() - kShown
        << " more; --json lists them all\n";
  }
}

void Print(const VerifyOutcome& outcome, std::ostream& out) {
  GroupTable(outcome.report).Print(out);
  out << "Largest errors. WEIGHTS absolute; PSI by D (2D: D (1 + |log D|)); "
         "REPRODUCED and DEFORMED in double, STREAMED as float frames, by the "
         "rig's diagonal.\n";
  PrintFailures(outcome.report, out);
  int64_t cases = 0;
  int64_t queries = 0;
  int64_t otherwise = 0;
  for (const auto& [name, group] : outcome.report.groups) {
    cases += group.cases;
    queries += group.queries;
    otherwise += group.errors_named_otherwise;
  }
  if (otherwise > 0) {
    out << otherwise << " expected errors came under another name\n";
  }
  out << (outcome.ok() ? "OK: " : "FAILED: ") << Thousands(cases) << " cases, "
      << Thousands(queries) << " queries, "
      << Thousands(outcome.report.failures.size()) << " failures\n";
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  context.interruption.expected = true;
  Progress progress(context.console, "verifying", &context.interruption);
  const absl::StatusOr<VerifyOutcome> outcome =
      Verify(client, {.directory = options.directory,
                      .group_prefix = options.group,
                      .cases_at_a_time = options.jobs,
                      .interrupted = &context.interruption.requested,
                      .progress = progress.callback()});
  if (!outcome.ok()) {
    return DetailOf(outcome.status()).reason == "NO_CASES"
               ? WithExit(kCheckFailed, outcome.status())
               : outcome.status();
  }
  context.console.Result(ToJson(*outcome),
                         [&](std::ostream& out) { Print(*outcome, out); });
  if (!outcome->cleanup.ok()) {
    context.console.Note(absl::StrCat("could not delete everything: ",
                                      outcome->cleanup.message()));
  }
  for (const std::string& file : outcome->skipped) {
    if (file != "index.json") {
      context.console.Note(absl::StrCat("skipped ", file, ": it is no case"));
    }
  }
  if (outcome->ok()) return absl::OkStatus();
  return WithExit(kCheckFailed,
                  MakeError(absl::StatusCode::kFailedPrecondition,
                            "the server does not agree with the cases",
                            {.reason = "CHECK_FAILED"}));
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("directory", options->directory,
                 "Directory of case files (*.json, schema deform-golden/1)")
      ->required()
      ->type_name("DIR");
  app.add_option("--group", options->group,
                 "Only cases whose group begins with this")
      ->type_name("PREFIX");
  app.add_option("--jobs", options->jobs, "Cases at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& VerifyCommand() {
  static const Command command = {
      "verify", "Check a server against reference cases",
      "deformctl verify tests/golden\n"
      "deformctl verify tests/golden --group gc3d --json",
      "", Setup};
  return command;
}

}  // namespace deform::cli
