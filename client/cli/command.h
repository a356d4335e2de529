// The seam for subcommands. To add one: write commands/<name>.cc with a
// function <Name>Command(), then add one line to commands.cc.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/console.h"
#include "client/cli/interruption.h"
#include "client/cpp/client.h"

namespace CLI {
class App;
}

namespace deform::cli {

// Options that every subcommand takes.
struct Globals {
  std::string server = "127.0.0.1:7777";
  std::string tenant;
  double connect_timeout_s = 3;
  bool json = false;
};

// What a subcommand works with. Borrowed for the call.
struct Context {
  const Globals& globals;
  Console& console;
  const CLI::App& root;  // All commands and options.
  Interruption& interruption;

  // The server named by --server.
  absl::StatusOr<Client> Connect() const;
};

using Action = std::function<absl::Status(Context&)>;

struct Command {
  const char* name;
  const char* summary;   // One line.
  const char* examples;  // Lines without indentation.
  // Words that complete its first argument, for shells; may be empty.
  const char* words;
  // Adds options and arguments, and returns what is to be done with them.
  Action (*setup)(CLI::App& app);
};

// In the order of commands.cc, which is that of --help.
std::span<const Command* const> AllCommands();

}  // namespace deform::cli
