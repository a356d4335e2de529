// deformctl download: writes a registered model as a file.
#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/files.h"
#include "client/cli/progress.h"
#include "core/base/status_macros.h"
#include "core/files/mesh_file.h"

namespace deform::cli {
namespace {

struct Options {
  std::string model;
  std::string out;
};

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  Progress progress(context.console, "downloading", &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(
      const ModelArrays model,
      client.DownloadModel(options.model, progress.callback()));
  DEFORM_RETURN_IF_ERROR(
      WriteFile(options.out, ObjText(model.positions, model.faces)));
  const Json json = {{"model_id", options.model},
                     {"out", options.out},
                     {"dimension", model.dimension},
                     {"point_count", model.positions.rows()},
                     {"face_count", model.faces.rows()}};
  context.console.Result(json, [&](std::ostream& out) {
    out << Thousands(model.positions.rows()) << " points, "
        << Thousands(model.faces.rows()) << " triangles\nwrote " << options.out
        << "\n";
  });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("model", options->model, "Id of the model")
      ->required()
      ->type_name("MODEL");
  app.add_option("--out", options->out, "File to write (OBJ)")
      ->required()
      ->type_name("FILE");
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& DownloadCommand() {
  static const Command command = {
      "download", "Write a registered model as a file",
      "deformctl download $model --out model.obj", "", Setup};
  return command;
}

}  // namespace deform::cli
