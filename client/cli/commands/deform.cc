// deformctl deform: one pose in, a file out.
#include <CLI/CLI.hpp>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "client/cli/frame_options.h"
#include "client/cli/motion.h"
#include "client/cli/picture_options.h"
#include "client/cli/stage.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  StageOptions stage;
  std::string pose;
  std::string motion;
  double at = 0.25;
  double blend = 1;
  FrameOptions frames;
  std::string out;
  std::string png;
  PictureOptions picture;
};

absl::StatusOr<Positions> PoseOf(const Options& options, const Stage& stage) {
  if (options.motion.empty()) return stage.LoadPose(options.pose);
  return PoseOfMotion(options.motion, stage.rig().vertices,
                      stage.rig().dimension, options.at);
}

absl::Status Draw(const Options& options, const Stage& stage,
                  const Positions& pose, const Positions& deformed) {
  const MeshFile& model = *stage.model();
  Picture picture;
  picture.dimension = stage.binding().dimension;
  picture.faces = model.faces;
  picture.rig_faces = stage.rig().faces;
  picture.marked = stage.binding().clamped;
  picture.panels = {
      {absl::StrCat("at rest, ", Thousands(model.positions.rows()), " points"),
       model.positions, stage.rig().vertices},
      {absl::StrCat("posed, ", stage.binding().scheme), deformed, pose}};
  return DrawInto(options.png, options.picture, std::move(picture));
}

void Tell(const Options& options, const Stage& stage, const Frame& frame,
          Console& console) {
  const BindingInfo& binding = stage.binding();
  const Json json = {{"out", options.out},
                     {"png", options.png},
                     {"binding_id", binding.binding_id},
                     {"point_count", binding.point_count},
                     {"unbound_count", binding.unbound_count},
                     {"clamped_count", binding.clamped_count},
                     {"compute_seconds", binding.compute_seconds},
                     {"deform_us", frame.deform_us},
                     {"exit_mismatch", frame.exit_mismatch},
                     {"encoding", frame.encoding},
                     {"bytes", frame.bytes},
                     {"error_bound", frame.error_bound}};
  console.Result(json, [&](std::ostream& out) {
    out << absl::StrFormat(
        "%s points deformed in %s (weights: %s%s)\n",
        Thousands(binding.point_count), Seconds(1e-6 * frame.deform_us),
        Seconds(binding.compute_seconds), binding.existed ? ", cached" : "");
    if (binding.unbound_count > 0) {
      out << absl::StrFormat(
          "%s points are not bound and stay where they are\n",
          Thousands(binding.unbound_count));
    }
    if (binding.clamped_count > 0) {
      out << absl::StrFormat("%s points are clamped\n",
                             Thousands(binding.clamped_count));
    }
    for (const std::string* path : {&options.out, &options.png}) {
      if (!path->empty()) out << "wrote " << *path << "\n";
    }
  });
}

absl::Status Run(const Options& options, Context& context) {
  if (options.out.empty() && options.png.empty()) {
    return UsageError("say where the result goes: --out FILE or --png FILE");
  }
  if (!options.png.empty() && options.stage.model_file.empty()) {
    return UsageError("--png needs --model-file, for the faces to draw");
  }
  if (options.pose.empty() == options.motion.empty()) {
    return UsageError(
        "give the posed rig, --pose FILE, or a built-in --motion");
  }
  DEFORM_ASSIGN_OR_RETURN(const DeformOptions frames,
                          options.frames.For(Delivery::kEvery));
  DEFORM_ASSIGN_OR_RETURN(const std::unique_ptr<Stage> stage,
                          Stage::Open(context, options.stage));
  DEFORM_ASSIGN_OR_RETURN(const Positions pose, PoseOf(options, *stage));
  DEFORM_ASSIGN_OR_RETURN(
      const Frame frame,
      stage->DeformOnce({.positions = pose, .stretch_blend = options.blend},
                        frames));
  const Positions deformed = frame.DoublePositions();
  if (!options.out.empty()) {
    DEFORM_ASSIGN_OR_RETURN(const std::string bytes,
                            stage->FileWith(deformed, options.out));
    DEFORM_RETURN_IF_ERROR(WriteFile(options.out, bytes));
  }
  if (!options.png.empty()) {
    DEFORM_RETURN_IF_ERROR(Draw(options, *stage, pose, deformed));
  }
  Tell(options, *stage, frame, context.console);
  return stage->Close();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("--pose", options->pose,
                 "Posed cage or handles: a file with the rig's vertices, moved")
      ->type_name("FILE");
  app.add_option("--motion", options->motion,
                 absl::StrCat("Instead of a file: ", MotionList()))
      ->check(CLI::IsMember(MotionNames()));
  app.add_option("--at", options->at,
                 "Time of the motion; it begins and ends at rest, at 0 and 1")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--blend", options->blend,
                 "Stretch blend: 1 distorts least, 0 stretches freely")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--out", options->out,
                 "The model's file with its positions replaced; or .obj")
      ->type_name("FILE");
  app.add_option("--png", options->png, "Picture of rest and posed state")
      ->type_name("FILE");
  options->frames.AddTo(app);
  options->stage.AddTo(app);
  options->picture.AddTo(app);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& DeformCommand() {
  static const Command command = {
      "deform", "Deform a model by one pose and write the result",
      "deformctl deform --model-file a.obj --cage c.obj --pose posed.obj "
      "--out out.obj\n"
      "deformctl deform --model-file a.ply --handles h.obj --pose moved.obj "
      "--png out.png\n"
      "deformctl deform --model-file a.stl --cage c.obj --motion bend --at "
      "0.25 "
      "--out out.obj\n"
      "deformctl deform --binding $binding --model-file a.obj --pose posed.obj "
      "--out out.obj",
      "", Setup};
  return command;
}

}  // namespace deform::cli
