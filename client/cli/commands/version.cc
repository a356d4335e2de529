// deformctl version.
#include <CLI/CLI.hpp>

#include "client/cli/command.h"

namespace deform::cli {
namespace {

absl::Status Run(Context& context) {
  context.console.Result(
      {{"version", DEFORM_VERSION}, {"protocol", "deform.v1"}},
      [](std::ostream& out) {
        out << "deformctl " DEFORM_VERSION ", protocol deform.v1\n";
      });
  return absl::OkStatus();
}

Action Setup(CLI::App& /*app*/) { return Run; }

}  // namespace

const Command& VersionCommand() {
  static const Command command = {"version", "Print the version",
                                  "deformctl version", "", Setup};
  return command;
}

}  // namespace deform::cli
