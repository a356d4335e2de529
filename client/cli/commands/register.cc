// deformctl register: uploads a model.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/files.h"
#include "client/cli/info_text.h"
#include "client/cli/progress.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  std::string file;
  std::string name;
  int dimension = 0;
};

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(
      const MeshFile file,
      LoadMesh(options.file, ToFileDimension(options.dimension)));
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  const std::string name =
      options.name.empty()
          ? std::filesystem::path(options.file).filename().string()
          : options.name;
  Progress progress(context.console, "uploading", &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(
      const ModelInfo model,
      client.RegisterModel({file.dimension, file.positions, file.faces}, name,
                           progress.callback()));
  Json json = ToJson(model);
  json["existed"] = model.existed;
  context.console.Result(json, [&](std::ostream& out) {
    out << model.model_id << "\n";
    context.console.Note(Thousands(model.vertex_count) + " vertices, " +
                         Thousands(model.face_count) + " triangles" +
                         (model.existed ? "; was there before" : ""));
  });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("file", options->file, "Model: OBJ, OFF, PLY or STL")
      ->required()
      ->type_name("FILE");
  app.add_option("--name", options->name,
                 "Name for people; by default the file's")
      ->type_name("NAME");
  app.add_option("--dimension", options->dimension,
                 "2 or 3; by default 2 if the file is flat")
      ->check(CLI::IsMember({2, 3}))
      ->type_name("N");
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& RegisterCommand() {
  static const Command command = {
      "register", "Upload a model and print its id",
      "deformctl register bunny.obj\n"
      "model=$(deformctl register liver.ply --name liver)",
      "", Setup};
  return command;
}

}  // namespace deform::cli
