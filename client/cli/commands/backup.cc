// deformctl backup: a copy of all that a server stores, while it serves.
#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

absl::Status Run(const std::string& name, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  DEFORM_ASSIGN_OR_RETURN(const std::string directory, client.Backup(name));
  context.console.Result(Json{{"directory", directory}},
                         [&](std::ostream& out) { out << directory << "\n"; });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto name = std::make_shared<std::string>();
  app.add_option("name", *name,
                 "Of the backup: 1 to 64 letters, digits, _ and -.")
      ->required()
      ->type_name("NAME");
  return [name](Context& context) { return Run(*name, context); };
}

}  // namespace

const Command& BackupCommand() {
  static const Command command = {
      "backup", "Copy all that the server stores, while it serves",
      "deformctl backup monday          # prints where, on its machine\n"
      "cp -a DIRECTORY /another/disk    # large files are links until then\n"
      "deformd --data-dir NEW --restore /another/disk/monday",
      "", Setup};
  return command;
}

}  // namespace deform::cli
