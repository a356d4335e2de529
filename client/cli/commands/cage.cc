// deformctl cage: makes a cage for a model, without a server.
#include <CLI/CLI.hpp>
#include <memory>

#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/cage_making.h"

namespace deform::cli {
namespace {

struct Options {
  std::string model;
  std::string out;
  int dimension = 0;
  CageMakingOptions making;
};

absl::StatusOr<Cage> Make(const Options& options) {
  DEFORM_ASSIGN_OR_RETURN(
      const MeshFile file,
      LoadMesh(options.model, ToFileDimension(options.dimension)));
  const absl::StatusOr<Mesh> model =
      Mesh::Create(file.dimension, file.positions, file.faces);
  if (!model.ok()) return WithExit(kBadFile, model.status());
  const absl::StatusOr<Cage> cage = MakeCage(*model, options.making);
  if (cage.ok()) return cage;
  return WithExit(kBadFile, Annotate(cage.status(), options.model + ": "));
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(const Cage cage, Make(options));
  DEFORM_RETURN_IF_ERROR(
      WriteFile(options.out, ObjText(cage.vertices(), cage.faces())));
  const Json json = {{"out", options.out},
                     {"dimension", cage.dimension()},
                     {"vertex_count", cage.vertex_count()},
                     {"face_count", cage.face_count()},
                     {"diagonal", cage.diagonal()}};
  context.console.Result(json, [&](std::ostream& out) {
    out << absl::StrFormat("wrote %s: %s vertices, %s %s\n", options.out,
                           Thousands(cage.vertex_count()),
                           Thousands(cage.face_count()),
                           cage.dimension() == 2 ? "edges" : "faces");
  });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("file", options->model, "Model: OBJ, OFF, PLY or STL")
      ->required()
      ->type_name("FILE");
  app.add_option("--out", options->out, "Cage to write (OBJ)")
      ->required()
      ->type_name("FILE");
  app.add_option("--faces", options->making.target_faces,
                 "Faces to aim at, by default 200, in 2D 40 edges; shapes that "
                 "need more get more")
      ->check(CLI::Range(8, 20000));
  app.add_option("--margin", options->making.margin,
                 "Room around the model, in its diagonals; more makes a "
                 "simpler, looser cage")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--dimension", options->dimension,
                 "2: loops; 3: a surface; by default 2 if the file is flat")
      ->check(CLI::IsMember({2, 3}))
      ->type_name("N");
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& CageCommand() {
  static const Command command = {
      "cage", "Make a cage for a model that has none (needs no server)",
      "deformctl cage liver.ply --out liver_cage.obj\n"
      "deformctl cage a.obj --faces 80 --margin 0.1 --out c.obj",
      "", Setup};
  return command;
}

}  // namespace deform::cli
