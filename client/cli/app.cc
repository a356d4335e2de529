#include "client/cli/app.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "core/base/error.h"

namespace deform::cli {
namespace {

constexpr char kFooter[] =
    "Exit codes: 0 done; 1 a check failed; 2 bad arguments; 3 a file cannot "
    "be\n"
    "read, understood or written; 4 the server refused; 5 no server answers;\n"
    "130 interrupted.\n"
    "'deformctl COMMAND --help' shows the options of a command, with examples.";

void AddGlobals(CLI::App& app, Globals& globals) {
  app.add_option("--server", globals.server,
                 "Address of deformd: HOST:PORT or unix:PATH")
      ->envname("DEFORM_SERVER")
      ->capture_default_str()
      ->type_name("ADDRESS");
  app.add_option("--tenant", globals.tenant,
                 "Whose data: separates those who share a server")
      ->envname("DEFORM_TENANT")
      ->type_name("NAME");
  app.add_option("--connect-timeout", globals.connect_timeout_s,
                 "Seconds to wait for the server")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str()
      ->type_name("SECONDS");
  app.add_flag("--json", globals.json,
               "Print the result, or the error, as JSON on standard output");
}

CLI::App* AddCommand(CLI::App& app, const Command& command) {
  CLI::App* const sub = app.add_subcommand(command.name, command.summary);
  sub->footer(
      absl::StrCat("Examples:\n  ",
                   absl::StrReplaceAll(command.examples, {{"\n", "\n  "}})));
  return sub;
}

// The command that was chosen, if the parse got that far.
const CLI::App& Chosen(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : *chosen.front();
}

// CLI11 tells of a command that there is not only that one is required.
std::string WhatIsWrong(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<std::string> rest = app.remaining();
  const auto word = std::find_if(
      rest.begin(), rest.end(),
      [](const std::string& text) { return text.empty() || text[0] != '-'; });
  if (!app.get_subcommands().empty() || word == rest.end()) {
    return error.what();
  }
  std::vector<absl::string_view> names;
  for (const Command* command : AllCommands()) names.push_back(command->name);
  return absl::StrCat("there is no command '", *word, "', only ",
                      absl::StrJoin(names, ", "));
}

int EndParse(const CLI::App& app, const CLI::ParseError& error,
             Console& console) {
  if (error.get_exit_code() == 0) {
    console.out() << Chosen(app).help(
        app.get_subcommands().empty() ? "" : app.get_name());
    return kOk;
  }
  const bool top = app.get_subcommands().empty();
  console.Error(UsageError(absl::StrCat(
      WhatIsWrong(app, error), "; see 'deformctl ",
      top ? "" : Chosen(app).get_name(), top ? "" : " ", "--help'")));
  return kUsage;
}

}  // namespace

absl::StatusOr<Client> Context::Connect() const {
  ClientOptions options;
  options.tenant = globals.tenant;
  options.connect_timeout = std::chrono::milliseconds(
      static_cast<int64_t>(1000 * globals.connect_timeout_s));
  return Client::Connect(globals.server, options);
}

int RunDeformctl(std::vector<std::string> arguments, const Terminal& terminal) {
  Globals globals;
  CLI::App app("Deforms models through a deformd server.", "deformctl");
  app.footer(kFooter);
  app.require_subcommand(1);
  app.fallthrough();
  AddGlobals(app, globals);
  std::vector<std::pair<CLI::App*, Action>> actions;
  for (const Command* command : AllCommands()) {
    CLI::App* const sub = AddCommand(app, *command);
    actions.emplace_back(sub, command->setup(*sub));
  }
  // A usage error is told as JSON too, whatever the parser made of the rest.
  const bool json = std::find(arguments.begin(), arguments.end(), "--json") !=
                    arguments.end();
  Console console(terminal.out, terminal.err, json, terminal.err_is_terminal);
  try {
    std::reverse(arguments.begin(), arguments.end());  // CLI11 pops the last.
    app.parse(std::move(arguments));
  } catch (const CLI::ParseError& error) {
    return EndParse(app, error, console);
  }
  Context context{globals, console, app, terminal.interruption};
  for (const auto& [sub, action] : actions) {
    if (!sub->parsed()) continue;
    const absl::Status status = action(context);
    // A check that failed has told so in its result.
    const bool told = DetailOf(status).reason == "CHECK_FAILED";
    if (!status.ok() && !told) console.Error(status);
    return ExitCodeOf(status);
  }
  return kUsage;
}

}  // namespace deform::cli
