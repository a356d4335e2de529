// deformctl compare: one model posed by several schemes, side by side.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "client/cli/command.h"
#include "client/cli/comparison_picture.h"
#include "client/cli/exit_code.h"
#include "client/cli/motion.h"
#include "client/cli/picture_options.h"
#include "client/cli/progress.h"
#include "client/cli/quality_picture.h"
#include "client/cli/quality_text.h"
#include "client/cli/stage.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  RigOptions rig;  // Of which each scheme takes the cage or the handles.
  std::string model_file;
  std::string schemes;
  std::string cage_pose;
  std::string handles_pose;
  std::string motion;
  double at = 0.25;
  double blend = 1;
  std::string color = "distortion";
  int64_t handle = 0;
  std::string title;
  std::string png;
  PictureOptions picture;
};

absl::StatusOr<std::vector<std::string>> SchemesOf(const Options& options) {
  if (!options.schemes.empty()) {
    return std::vector<std::string>(absl::StrSplit(options.schemes, ','));
  }
  std::vector<std::string> schemes;
  if (!options.rig.cage.empty()) schemes = {"green", "mean_value"};
  if (!options.rig.handles.empty()) {
    schemes.insert(schemes.end(), {"t_cc", "s_cc"});
  }
  if (!schemes.empty()) return schemes;
  return UsageError(
      "say what is to be compared: --cage FILE, --handles FILE, or both");
}

absl::Status CheckOptions(const Options& options) {
  const bool cage_pose = !options.cage_pose.empty();
  const bool handles_pose = !options.handles_pose.empty();
  if (options.motion.empty() == !(cage_pose || handles_pose) &&
      options.color != "influence") {
    return UsageError(
        "give the posed rigs, --cage-pose and --handles-pose, or a built-in "
        "--motion");
  }
  if (options.motion.empty() && options.color != "influence" &&
      (cage_pose != !options.rig.cage.empty() ||
       handles_pose != !options.rig.handles.empty())) {
    return UsageError(
        "each rig needs its pose: --cage with --cage-pose, --handles with "
        "--handles-pose");
  }
  return absl::OkStatus();
}

// What a stage of this scheme stands on.
StageOptions StageFor(const Options& options, const std::string& scheme,
                      bool caged) {
  StageOptions stage{.model_file = options.model_file, .rig = options.rig};
  stage.rig.scheme = scheme;
  (caged ? stage.rig.handles : stage.rig.cage).clear();
  if (!caged) {
    stage.rig.exit.clear();
    stage.rig.exit_per_point.clear();
  }
  if (scheme != "t_cc") stage.rig.handle_weights.clear();
  if (scheme != "s_cc") stage.rig.lambda = 0;
  return stage;
}

absl::StatusOr<PoseUpdate> PoseFor(const Options& options, const Stage& stage,
                                   bool caged) {
  PoseUpdate pose{.stretch_blend = options.blend};
  const std::string& path = caged ? options.cage_pose : options.handles_pose;
  if (!options.motion.empty()) {
    DEFORM_ASSIGN_OR_RETURN(pose.positions,
                            PoseOfMotion(options.motion, stage.rig().vertices,
                                         stage.rig().dimension, options.at));
  } else if (!path.empty()) {
    DEFORM_ASSIGN_OR_RETURN(pose.positions, stage.LoadPose(path));
  } else {
    pose.positions = stage.rig().vertices;
  }
  return pose;
}

absl::StatusOr<bool> TakesCage(Client& client, const std::string& scheme) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<SchemeInfo> schemes,
                          client.ListSchemes());
  std::string known;
  for (const SchemeInfo& info : schemes) {
    if (info.scheme == scheme) return info.takes_cage;
    absl::StrAppend(&known, known.empty() ? "" : ", ", info.scheme);
  }
  return UsageError(absl::StrCat("--schemes: there is no '", scheme,
                                 "'; the server knows ", known));
}

absl::StatusOr<std::vector<double>> ValuesFor(const Options& options,
                                              Stage& stage,
                                              const ComparedScheme& scheme) {
  const int64_t points = stage.binding().point_count;
  if (options.color == "influence") {
    return stage.InfluenceOfVertex(options.handle);
  }
  if (options.color == "distortion") {
    return DistortionOf(*scheme.quality.pose, points);
  }
  return DisplacementOf(stage.model()->positions, scheme.deformed);
}

absl::StatusOr<ComparedScheme> Compare(const Options& options, Context& context,
                                       const std::string& name, bool caged,
                                       Comparison& comparison) {
  if ((caged ? options.rig.cage : options.rig.handles).empty()) {
    return UsageError(absl::StrCat("scheme ", name, " needs ",
                                   caged ? "--cage" : "--handles"));
  }
  DEFORM_ASSIGN_OR_RETURN(const std::unique_ptr<Stage> stage,
                          Stage::Open(context, StageFor(options, name, caged)));
  ComparedScheme scheme{.name = name, .caged = caged};
  DEFORM_ASSIGN_OR_RETURN(const PoseUpdate pose,
                          PoseFor(options, *stage, caged));
  DEFORM_ASSIGN_OR_RETURN(const Frame frame, stage->DeformOnce(pose));
  scheme.deformed = frame.DoublePositions();
  scheme.rig = pose.positions;
  scheme.binding = stage->binding();
  Progress measuring(context.console, absl::StrCat("measuring ", name),
                     &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(
      scheme.quality, stage->client().GetQuality(
                          {.binding_id = stage->binding().binding_id,
                           .pose = pose,
                           .max_points = std::min(stage->binding().point_count,
                                                  kMostMeasuredPoints),
                           .with_points = true},
                          measuring.callback()));
  DEFORM_ASSIGN_OR_RETURN(scheme.values, ValuesFor(options, *stage, scheme));
  if (comparison.rest.rows() == 0 || (caged && !comparison.rest_caged)) {
    comparison.dimension = stage->binding().dimension;
    comparison.rest = stage->model()->positions;
    comparison.faces = stage->model()->faces;
    comparison.rest_rig = stage->rig().vertices;
    comparison.rest_caged = caged;
  }
  if (caged) comparison.cage_faces = stage->rig().faces;
  DEFORM_RETURN_IF_ERROR(stage->Close());
  return scheme;
}

void Tell(const Options& options, const Comparison& comparison,
          Console& console) {
  Json schemes = Json::array();
  Table table({{"scheme"},
               {"weights", Table::Align::kRight},
               {"median", Table::Align::kRight},
               {"p99", Table::Align::kRight},
               {"max", Table::Align::kRight},
               {"fold-overs", Table::Align::kRight},
               {"volume", Table::Align::kRight}});
  for (const ComparedScheme& scheme : comparison.schemes) {
    const PoseQuality& pose = *scheme.quality.pose;
    schemes.push_back({{"scheme", scheme.name},
                       {"rig_vertex_count", scheme.binding.vertex_count},
                       {"compute_seconds", scheme.binding.compute_seconds},
                       {"unbound_count", scheme.binding.unbound_count},
                       {"quality", ToJson(scheme.quality)}});
    const auto number = [](double value) {
      return absl::StrFormat("%.4g", value);
    };
    table.Add({scheme.name, Seconds(scheme.binding.compute_seconds),
               number(pose.distortion_median), number(pose.distortion_p99),
               number(pose.distortion_max), Thousands(pose.fold_overs),
               VolumeChangeText(pose)});
  }
  const Json json = {{"model_file", options.model_file},
                     {"point_count", comparison.rest.rows()},
                     {"png", options.png},
                     {"schemes", schemes}};
  console.Result(json, [&](std::ostream& out) {
    table.Print(out);
    if (!options.png.empty()) out << "wrote " << options.png << "\n";
  });
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_RETURN_IF_ERROR(CheckOptions(options));
  DEFORM_ASSIGN_OR_RETURN(const std::vector<std::string> schemes,
                          SchemesOf(options));
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  Comparison comparison{
      .title = options.title, .color = options.color, .handle = options.handle};
  for (const std::string& name : schemes) {
    DEFORM_ASSIGN_OR_RETURN(const bool caged, TakesCage(client, name));
    DEFORM_ASSIGN_OR_RETURN(ComparedScheme scheme,
                            Compare(options, context, name, caged, comparison));
    comparison.schemes.push_back(std::move(scheme));
  }
  if (!options.png.empty()) {
    DEFORM_ASSIGN_OR_RETURN(const Image image,
                            DrawComparison(comparison, options.picture));
    DEFORM_RETURN_IF_ERROR(SavePng(image, options.png));
  }
  Tell(options, comparison, context.console);
  return absl::OkStatus();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  options->picture.width = 480;
  options->picture.height = 480;
  app.add_option("--model-file", options->model_file,
                 "Model: OBJ, OFF, PLY or STL")
      ->required()
      ->type_name("FILE");
  app.add_option(
         "--schemes", options->schemes,
         "What to compare, in order; by default green, mean_value for a "
         "cage, t_cc, s_cc for handles")
      ->type_name("NAME,...");
  auto* const cage_pose =
      app.add_option("--cage-pose", options->cage_pose, "The posed cage")
          ->type_name("FILE");
  auto* const handles_pose =
      app.add_option("--handles-pose", options->handles_pose,
                     "The posed handles")
          ->type_name("FILE");
  app.add_option("--motion", options->motion,
                 absl::StrCat("Pose both by a moment of a built-in motion: ",
                              MotionList()))
      ->check(CLI::IsMember(MotionNames()))
      ->excludes(cage_pose)
      ->excludes(handles_pose);
  app.add_option("--at", options->at, "Time of the motion, from 0 to 1")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--blend", options->blend,
                 "Stretch blend: 1 distorts least, 0 stretches freely")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--color", options->color,
                 "What the colours show; influence needs no pose")
      ->check(CLI::IsMember({"distortion", "displacement", "influence"}))
      ->capture_default_str();
  app.add_option("--handle", options->handle,
                 "For influence: which vertex of the rig")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--title", options->title, "Above the picture")
      ->type_name("TEXT");
  app.add_option("--png", options->png, "Picture to write")->type_name("FILE");
  options->rig.AddTo(app, /*both=*/true);
  options->picture.AddTo(app);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& CompareCommand() {
  static const Command command = {
      "compare", "Compare schemes on one model, side by side",
      "deformctl compare --model-file a.obj --cage c.obj --cage-pose posed.obj "
      "--png ab.png\n"
      "deformctl compare --model-file a.obj --cage c.obj --handles h.obj "
      "--motion twist --json\n"
      "deformctl compare --model-file a.obj --handles h.obj --color influence "
      "--handle 12 --png weights.png",
      "", Setup};
  return command;
}

}  // namespace deform::cli
