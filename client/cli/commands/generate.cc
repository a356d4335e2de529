// deformctl generate: writes a generated model and its rigs, without a server.
#include <CLI/CLI.hpp>
#include <memory>

#include "absl/strings/str_cat.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "client/shapes/shapes.h"
#include "core/base/status_macros.h"
#include "core/files/mesh_file.h"

namespace deform::cli {
namespace {

struct Options {
  std::string name;
  std::string out;
  std::string cage;
  std::string handles;
  int64_t points = 10000;
};

absl::Status Run(const Options& options, Context& context) {
  const absl::StatusOr<GeneratedShape> shape =
      GenerateShape(options.name, options.points);
  if (!shape.ok()) return WithExit(kUsage, shape.status());
  if (!options.cage.empty() && shape->cage.rows() == 0) {
    return UsageError(absl::StrCat(options.name,
                                   " comes without a cage: let 'deformctl cage'"
                                   " make one from it"));
  }
  std::vector<std::string> written;
  const auto write = [&](const std::string& path, const Positions& positions,
                         const Faces& faces) -> absl::Status {
    if (path.empty()) return absl::OkStatus();
    written.push_back(path);
    return WriteFile(path, ObjText(positions, faces));
  };
  DEFORM_RETURN_IF_ERROR(write(options.out, shape->positions, shape->faces));
  DEFORM_RETURN_IF_ERROR(write(options.cage, shape->cage, shape->cage_faces));
  DEFORM_RETURN_IF_ERROR(write(options.handles, shape->handles, Faces(0, 3)));
  const Json json = {{"out", options.out},
                     {"cage", options.cage},
                     {"handles", options.handles},
                     {"dimension", shape->dimension},
                     {"point_count", shape->positions.rows()},
                     {"face_count", shape->faces.rows()},
                     {"cage_vertex_count", shape->cage.rows()},
                     {"handle_count", shape->handles.rows()}};
  context.console.Result(json, [&](std::ostream& out) {
    out << options.name << ": " << Thousands(shape->positions.rows())
        << " points, " << Thousands(shape->faces.rows()) << " triangles, "
        << shape->handles.rows() << " handles\n";
    for (const std::string& path : written) out << "wrote " << path << "\n";
  });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("shape", options->name, "What to generate")
      ->required()
      ->check(CLI::IsMember(ShapeNames()));
  app.add_option("--out", options->out, "Model to write (OBJ)")
      ->required()
      ->type_name("FILE");
  app.add_option("--cage", options->cage, "Also write a cage around it (OBJ)")
      ->type_name("FILE");
  app.add_option("--handles", options->handles,
                 "Also write free control points for it (OBJ)")
      ->type_name("FILE");
  app.add_option("--points", options->points, "Points of the model, about")
      ->check(CLI::Range(int64_t{100}, int64_t{1000000}))
      ->capture_default_str();
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& GenerateCommand() {
  static const Command command = {
      "generate", "Write a model of its own with rigs (needs no server)",
      "deformctl generate organ --out heart.obj --handles heart_handles.obj\n"
      "deformctl generate bar --out bar.obj --cage bar_cage.obj --points 3000",
      "organ bar torus plate angle", Setup};
  return command;
}

}  // namespace deform::cli
