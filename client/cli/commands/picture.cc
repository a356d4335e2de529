// deformctl picture: draws files, without a server.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "client/cli/picture_options.h"
#include "client/cli/rig_options.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  std::string model;
  std::string cage;
  std::vector<std::string> posed;
  std::vector<std::string> posed_cages;
  std::vector<std::string> captions;
  int dimension = 0;
  std::string out;
  PictureOptions picture;
};

absl::StatusOr<Positions> LoadSameCount(const std::string& path, int dimension,
                                        int64_t count) {
  DEFORM_ASSIGN_OR_RETURN(const MeshFile file,
                          LoadMesh(path, ToFileDimension(dimension)));
  if (file.positions.rows() == count) return file.positions;
  return WithExit(
      kBadFile, InvalidInput("WRONG_LENGTH", "",
                             absl::StrCat(path, ": has ", file.positions.rows(),
                                          " vertices, not ", count)));
}

absl::StatusOr<Picture> Load(const Options& options) {
  Picture picture;
  DEFORM_ASSIGN_OR_RETURN(
      MeshFile model,
      LoadMesh(options.model, ToFileDimension(options.dimension)));
  DEFORM_ASSIGN_OR_RETURN(
      picture.dimension,
      ChooseDimension({.cage = options.cage, .dimension = options.dimension},
                      model.dimension));
  if (picture.dimension != model.dimension) {
    DEFORM_ASSIGN_OR_RETURN(
        model, LoadMesh(options.model, ToFileDimension(picture.dimension)));
  }
  picture.faces = model.faces;
  RigArrays cage;
  cage.vertices.resize(0, 3);
  if (!options.cage.empty()) {
    DEFORM_ASSIGN_OR_RETURN(
        const MeshFile file,
        LoadMesh(options.cage, ToFileDimension(picture.dimension)));
    cage.vertices = file.positions;
    cage.faces = picture.dimension == 2 ? file.edges : file.faces;
  }
  picture.rig_faces = cage.faces;
  picture.panels.push_back({"", model.positions, cage.vertices});
  for (size_t k = 0; k < options.posed.size(); ++k) {
    PicturePanel panel;
    DEFORM_ASSIGN_OR_RETURN(panel.positions,
                            LoadSameCount(options.posed[k], picture.dimension,
                                          model.positions.rows()));
    panel.rig.resize(0, 3);
    if (k < options.posed_cages.size()) {
      DEFORM_ASSIGN_OR_RETURN(
          panel.rig, LoadSameCount(options.posed_cages[k], picture.dimension,
                                   cage.vertices.rows()));
    }
    picture.panels.push_back(std::move(panel));
  }
  for (size_t k = 0; k < options.captions.size() && k < picture.panels.size();
       ++k) {
    picture.panels[k].caption = options.captions[k];
  }
  return picture;
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_ASSIGN_OR_RETURN(Picture picture, Load(options));
  DEFORM_RETURN_IF_ERROR(
      DrawInto(options.out, options.picture, std::move(picture)));
  context.console.Result({{"out", options.out}}, [&](std::ostream& out) {
    out << "wrote " << options.out << "\n";
  });
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("file", options->model, "Model: OBJ, OFF, PLY or STL")
      ->required()
      ->type_name("FILE");
  app.add_option("--out", options->out, "Picture to write (PNG)")
      ->required()
      ->type_name("FILE");
  app.add_option("--cage", options->cage, "Draw this cage around it")
      ->type_name("FILE");
  app.add_option("--posed", options->posed,
                 "Draw the posed model beside it; may be given again")
      ->type_name("FILE");
  app.add_option("--posed-cage", options->posed_cages,
                 "The cage of the posed model; may be given again")
      ->type_name("FILE")
      ->needs("--cage")
      ->needs("--posed");
  app.add_option("--caption", options->captions,
                 "Caption of a panel; may be given again")
      ->type_name("TEXT");
  app.add_option("--dimension", options->dimension,
                 "2 or 3; by default 2 if the files are flat")
      ->check(CLI::IsMember({2, 3}))
      ->type_name("N");
  options->picture.AddTo(app);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& PictureCommand() {
  static const Command command = {
      "picture", "Draw a model, and its cage, as PNG (needs no server)",
      "deformctl picture a.obj --out a.png\n"
      "deformctl picture a.obj --cage c.obj --posed b.obj --posed-cage d.obj "
      "--caption rest --caption posed --out ab.png\n"
      "deformctl picture a.obj --view 45,10 --up z --out a.png",
      "", Setup};
  return command;
}

}  // namespace deform::cli
