// deformctl show: one model, binding or session.
#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/info_text.h"
#include "client/cli/things.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

absl::Status Run(const std::string& id, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  DEFORM_ASSIGN_OR_RETURN(const Thing thing, FindThing(client, id));
  std::visit(
      [&](const auto& info) {
        Json json = {{"kind", KindOf(thing)}};
        json.update(ToJson(info));
        context.console.Result(json,
                               [&](std::ostream& out) { Describe(info, out); });
      },
      thing);
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto id = std::make_shared<std::string>();
  app.add_option("id", *id, "Id of a model, binding or session")
      ->required()
      ->type_name("ID");
  return [id](Context& context) { return Run(*id, context); };
}

}  // namespace

const Command& ShowCommand() {
  static const Command command = {
      "show", "Show a model, binding or session",
      "deformctl show $binding\n"
      "deformctl show $binding --json | jq .unbound",
      "", Setup};
  return command;
}

}  // namespace deform::cli
