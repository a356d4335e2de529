#include "client/cli/command.h"

// To add a subcommand: write commands/<name>.cc, then add one line here.
#define DEFORM_COMMANDS(X) \
  X(Register)              \
  X(Bind)                  \
  X(Handles)               \
  X(Deform)                \
  X(Play)                  \
  X(List)                  \
  X(Show)                  \
  X(Delete)                \
  X(Download)              \
  X(Weights)               \
  X(Report)                \
  X(Compare)               \
  X(Cage)                  \
  X(Generate)              \
  X(Picture)               \
  X(Verify)                \
  X(Status)                \
  X(Backup)                \
  X(Load)                  \
  X(Completion)            \
  X(Version)

namespace deform::cli {

#define DEFORM_DECLARE(name) const Command& name##Command();
DEFORM_COMMANDS(DEFORM_DECLARE)
#undef DEFORM_DECLARE

std::span<const Command* const> AllCommands() {
#define DEFORM_ADDRESS(name) &name##Command(),
  static const Command* const commands[] = {DEFORM_COMMANDS(DEFORM_ADDRESS)};
#undef DEFORM_ADDRESS
  return commands;
}

}  // namespace deform::cli
