// deformctl bind: computes weights.
#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/info_text.h"
#include "client/cli/progress.h"
#include "client/cli/rig_options.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  std::string model;
  RigOptions rig;
};

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  DEFORM_ASSIGN_OR_RETURN(const ModelInfo model,
                          client.GetModel(options.model));
  // Another --dimension than the model's is for the server to refuse.
  DEFORM_ASSIGN_OR_RETURN(
      BindingSpec spec,
      LoadSpec(options.rig, options.rig.dimension != 0 ? options.rig.dimension
                                                       : model.dimension));
  spec.model_id = options.model;
  Progress progress(context.console, "computing weights",
                    &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo binding,
                          client.CreateBinding(spec, progress.callback()));
  Json json = ToJson(binding);
  json["existed"] = binding.existed;
  context.console.Result(json,
                         [&](std::ostream& out) { Describe(binding, out); });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("model", options->model, "Id of the model")
      ->required()
      ->type_name("MODEL");
  options->rig.AddTo(app);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& BindCommand() {
  static const Command command = {
      "bind", "Compute the weights of a model in a cage or by handles",
      "deformctl bind $model --cage cage.obj\n"
      "deformctl bind $model --cage partial.obj --exit auto\n"
      "deformctl bind $model --cage cage.obj --scheme mean_value\n"
      "deformctl bind $model --cage cage.obj --clamp 0,17,18\n"
      "deformctl bind $model --cage cage.obj --weight-tolerance 1e-4\n"
      "deformctl bind $model --handles points.obj --add-box\n"
      "deformctl bind $model --handles points.obj --scheme t_cc "
      "--handle-weights 0,0,1,0.5",
      "", Setup};
  return command;
}

}  // namespace deform::cli
