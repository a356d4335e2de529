// deformctl list: models, bindings, sessions or schemes.
#include <CLI/CLI.hpp>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "client/cli/info_text.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

constexpr Table::Align kRight = Table::Align::kRight;

struct Options {
  std::string what;
  std::string model;
};

void Print(Console& console, const char* key, const Json& list,
           const Table& table) {
  console.Result({{key, list}}, [&](std::ostream& out) {
    if (table.empty()) {
      console.Note(absl::StrCat("no ", key));
    } else {
      table.Print(out);
    }
  });
}

absl::Status ListModels(Client& client, Console& console) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<ModelInfo> models,
                          client.ListModels());
  Json list = Json::array();
  Table table({{"MODEL"},
               {"DIM"},
               {"VERTICES", kRight},
               {"TRIANGLES", kRight},
               {"CREATED"},
               {"NAME"}});
  for (const ModelInfo& model : models) {
    list.push_back(ToJson(model));
    table.Add({model.model_id, absl::StrCat(model.dimension, "D"),
               Thousands(model.vertex_count), Thousands(model.face_count),
               TimeText(model.create_time), model.display_name});
  }
  Print(console, "models", list, table);
  return absl::OkStatus();
}

absl::Status ListBindings(Client& client, const std::string& model,
                          Console& console) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<BindingInfo> bindings,
                          client.ListBindings(model));
  Json list = Json::array();
  Table table({{"BINDING"},
               {"MODEL"},
               {"SCHEME"},
               {"POINTS", kRight},
               {"COLUMNS", kRight},
               {"MEMORY", kRight},
               {"FORM"},
               {"RATIO", kRight},
               {"BOUND", kRight},
               {"KEPT"},
               {"LAST USE"},
               {"NOT BOUND", kRight},
               {"CREATED"}});
  for (const BindingInfo& binding : bindings) {
    list.push_back(ToJson(binding));
    table.Add(
        {binding.binding_id, binding.model_id.substr(0, 12), binding.scheme,
         Thousands(binding.point_count),
         Thousands(binding.vertex_count + binding.normal_count),
         Bytes(binding.weight_bytes), WeightFormText(binding.weight_form),
         absl::StrFormat("%.3g", binding.compression_ratio),
         absl::StrFormat("%.2g", binding.weight_error_bound),
         WeightStateText(binding.weight_state), TimeText(binding.last_use_time),
         Thousands(binding.unbound_count), TimeText(binding.create_time)});
  }
  Print(console, "bindings", list, table);
  return absl::OkStatus();
}

absl::Status ListSessions(Client& client, Console& console) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<SessionInfo> sessions,
                          client.ListSessions());
  Json list = Json::array();
  Table table({{"SESSION"},
               {"BINDING"},
               {"REVISION", kRight},
               {"PARTICIPANTS", kRight},
               {"CREATED"}});
  for (const SessionInfo& session : sessions) {
    list.push_back(ToJson(session));
    table.Add({session.session_id, session.binding_id,
               absl::StrCat(session.revision),
               absl::StrCat(session.participant_count),
               TimeText(session.create_time)});
  }
  Print(console, "sessions", list, table);
  return absl::OkStatus();
}

absl::Status ListSchemes(Client& client, Console& console) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<SchemeInfo> schemes,
                          client.ListSchemes());
  Json list = Json::array();
  Table table({{"SCHEME"}, {"RIG"}, {"DESCRIPTION"}});
  for (const SchemeInfo& scheme : schemes) {
    list.push_back(ToJson(scheme));
    table.Add({scheme.scheme, scheme.takes_cage ? "--cage" : "--handles",
               scheme.description});
  }
  Print(console, "schemes", list, table);
  return absl::OkStatus();
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  if (options.what == "models") return ListModels(client, context.console);
  if (options.what == "sessions") return ListSessions(client, context.console);
  if (options.what == "schemes") return ListSchemes(client, context.console);
  return ListBindings(client, options.model, context.console);
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("what", options->what, "What to list")
      ->required()
      ->check(CLI::IsMember({"models", "bindings", "sessions", "schemes"}));
  app.add_option("--model", options->model, "Only bindings of this model")
      ->type_name("MODEL");
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& ListCommand() {
  static const Command command = {
      "list", "List models, bindings, sessions or coordinate schemes",
      "deformctl list models\n"
      "deformctl list bindings --model $model\n"
      "deformctl list sessions --json | jq -r '.sessions[].session_id'",
      "models bindings sessions schemes", Setup};
  return command;
}

}  // namespace deform::cli
