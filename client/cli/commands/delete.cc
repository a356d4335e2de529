// deformctl delete: models, bindings and sessions.
#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/things.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

absl::Status Run(const std::vector<std::string>& ids, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  Json deleted = Json::array();
  for (const std::string& id : ids) {
    DEFORM_ASSIGN_OR_RETURN(const Thing thing, FindThing(client, id));
    DEFORM_RETURN_IF_ERROR(DeleteThing(client, thing));
    deleted.push_back({{"kind", KindOf(thing)}, {"id", id}});
  }
  context.console.Result({{"deleted", deleted}}, [&](std::ostream& out) {
    for (const Json& thing : deleted) {
      out << "deleted " << thing["kind"].get<std::string>() << " "
          << thing["id"].get<std::string>() << "\n";
    }
  });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto ids = std::make_shared<std::vector<std::string>>();
  app.add_option("id", *ids, "Ids of models, bindings or sessions, in order")
      ->required()
      ->type_name("ID");
  return [ids](Context& context) { return Run(*ids, context); };
}

}  // namespace

const Command& DeleteCommand() {
  static const Command command = {
      "delete", "Delete sessions, bindings or models",
      "deformctl delete $session $binding $model", "", Setup};
  return command;
}

}  // namespace deform::cli
