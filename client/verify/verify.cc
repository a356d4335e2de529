#include "client/verify/verify.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <system_error>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/verify/golden_case.h"
#include "client/verify/run_case.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

absl::Status NoCases(absl::string_view message) {
  return MakeError(absl::StatusCode::kNotFound, message,
                   {.reason = "NO_CASES"});
}

absl::StatusOr<std::vector<std::filesystem::path>> JsonFiles(
    const std::string& directory) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry :
       std::filesystem::directory_iterator(directory, error)) {
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  }
  if (error) {
    return NoCases(absl::StrCat(directory, ": ", error.message()));
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Reads every case; what cannot be read is a failure of the group "unreadable".
absl::StatusOr<std::vector<GoldenCase>> ReadCases(const VerifyOptions& options,
                                                  VerifyOutcome& outcome) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<std::filesystem::path> files,
                          JsonFiles(options.directory));
  std::vector<GoldenCase> cases;
  for (const std::filesystem::path& path : files) {
    std::ifstream stream(path, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(stream)), {});
    const std::string name = path.filename().string();
    absl::StatusOr<std::optional<GoldenCase>> golden =
        ParseGoldenCase(text, name);
    if (!golden.ok()) {
      GoldenCase unreadable;
      unreadable.id = name;
      unreadable.group = "unreadable";
      outcome.report.Fail(unreadable, -1,
                          std::string(golden.status().message()));
    } else if (!*golden) {
      outcome.skipped.push_back(name);
    } else if (absl::StartsWith((*golden)->group, options.group_prefix)) {
      cases.push_back(*std::move(*golden));
    }
  }
  if (cases.empty() && outcome.report.failures.empty()) {
    return NoCases(absl::StrCat(
        options.directory, ": holds no case of the schema deform-golden/1",
        options.group_prefix.empty() ? "" : " in a group that begins with ",
        options.group_prefix));
  }
  return cases;
}

void JudgeResult(const GoldenCase& golden,
                 const absl::StatusOr<CaseResult>& result,
                 VerifyReport& report) {
  if (result.ok()) return JudgeCase(golden, *result, report);
  GroupReport& group = report.groups[golden.group];
  ++group.cases;
  group.queries += static_cast<int64_t>(golden.queries.size());
  report.Fail(golden, -1,
              absl::StrCat("could not be run: ", result.status().message()));
}

// Results by case, computed a few cases at a time.
std::vector<absl::StatusOr<CaseResult>> RunCases(
    Client& client, const std::vector<GoldenCase>& cases,
    const std::set<std::string>& schemes, const VerifyOptions& options,
    CreatedThings& created) {
  std::vector<absl::StatusOr<CaseResult>> results(
      cases.size(), absl::CancelledError("interrupted"));
  std::atomic<size_t> next = 0;
  std::atomic<int64_t> done = 0;
  const auto work = [&](bool tells) {
    for (size_t i = next++; i < cases.size(); i = next++) {
      if (options.interrupted != nullptr && *options.interrupted) return;
      if (schemes.count(cases[i].scheme) == 0) {
        results[i] = absl::NotFoundError(
            absl::StrCat("server has no scheme ", cases[i].scheme));
      } else {
        results[i] = RunCase(client, cases[i], created);
      }
      ++done;
      if (tells && options.progress &&
          !options.progress(done, static_cast<int64_t>(cases.size()))) {
        return;
      }
    }
  };
  std::vector<std::thread> helpers;
  for (int i = 1; i < options.cases_at_a_time; ++i) {
    helpers.emplace_back(work, false);
  }
  work(true);
  for (std::thread& helper : helpers) helper.join();
  return results;
}

}  // namespace

absl::StatusOr<VerifyOutcome> Verify(Client& client,
                                     const VerifyOptions& options) {
  VerifyOutcome outcome;
  DEFORM_ASSIGN_OR_RETURN(const std::vector<GoldenCase> cases,
                          ReadCases(options, outcome));
  DEFORM_ASSIGN_OR_RETURN(const std::vector<SchemeInfo> listed,
                          client.ListSchemes());
  std::set<std::string> schemes;
  for (const SchemeInfo& scheme : listed) schemes.insert(scheme.scheme);
  CreatedThings created;
  const auto results = RunCases(client, cases, schemes, options, created);
  outcome.cleanup = created.DeleteAll(client);
  if (options.interrupted != nullptr && *options.interrupted) {
    return absl::CancelledError("interrupted");
  }
  for (size_t i = 0; i < cases.size(); ++i) {
    JudgeResult(cases[i], results[i], outcome.report);
  }
  return outcome;
}

}  // namespace deform
