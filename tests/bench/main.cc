// deformd_bench: everything that speed is claimed of, side by side in one run.
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "tests/bench/benches.h"
#include "tests/bench/goals.h"

namespace deform::bench {
namespace {

constexpr char kAbout[] =
    "Measures deformd's weights, kernels and sessions against plain code, "
    "Eigen, the algorithm of [L08] (Lipman, Levin, Cohen-Or 2008) and the "
    "memory's read speed, in one run.\n"
    "Rows of one core count its own time, rows of all cores the time that "
    "passes; each is the best of several rounds in which all take turns. "
    "Quote ratios.\n"
    "Of Table 1 of [L08] the counts of its 173K model in a cage of 110/216 are "
    "taken; the paper's seconds, of a machine of 2008, are not repeated here.";

struct Arguments {
  Settings settings;
  std::string json, old;
  double tolerance = 0.3;
  bool fail = false;
};

int Fail(const absl::Status& status) {
  std::cerr << "deformd_bench: " << status.message() << "\n";
  return 2;
}

int Run(const Arguments& arguments) {
  std::vector<Row> rows;
  const auto add = [&](Row row) {
    PrintRow(row);
    rows.push_back(std::move(row));
  };
  PrintHeader();
  const ReadLimit limit = MeasureMemory(arguments.settings, add);
  MeasureWeightRows(arguments.settings, add);
  MeasureDeforming(arguments.settings, limit, add);
  MeasureSessions(arguments.settings, add);
  PrintGoals(rows);
  if (!arguments.json.empty()) {
    const absl::Status written = WriteJson(rows, arguments.json);
    if (!written.ok()) return Fail(written);
  }
  if (arguments.old.empty()) return 0;
  const auto slower = Compare(rows, arguments.old, arguments.tolerance);
  if (!slower.ok()) return Fail(slower.status());
  return arguments.fail && !slower->empty() ? 1 : 0;
}

int Main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app(kAbout, "deploy/bench");
  app.add_flag("--quick", arguments.settings.quick,
               "Fewer scenes, under a minute");
  app.add_option("--filter", arguments.settings.filter,
                 "Only scenes whose name contains this");
  app.add_option("--scale", arguments.settings.scale,
                 "Of all counts of points; the ratios are those of scale 1")
      ->check(CLI::Range(1e-4, 1.0));
  app.add_option("--json", arguments.json, "Also write the rows here");
  auto* compare = app.add_option(
      "--compare", arguments.old,
      "Print this older run's times beside ours, and what became slower");
  app.add_option("--tolerance", arguments.tolerance,
                 "By how much slower a row is told: 0.3 is 30 %")
      ->needs(compare)
      ->check(CLI::NonNegativeNumber);
  app.add_flag("--fail", arguments.fail, "Exit with 1 if a row became slower")
      ->needs(compare);
  CLI11_PARSE(app, argc, argv);
  return Run(arguments);
}

}  // namespace
}  // namespace deform::bench

int main(int argc, char** argv) { return deform::bench::Main(argc, argv); }
