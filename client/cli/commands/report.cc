// deformctl report: how good a binding is, and what a pose does to its model.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
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
  StageOptions stage;
  std::string session;
  std::string pose;
  std::string motion;
  double at = 0.25;
  double blend = 1;
  int64_t max_points = 0;
  std::string png;
  std::string color = "distortion";
  int64_t handle = 0;
  int64_t face = -1;
  PictureOptions picture;
};

// What is drawn of the model.
struct Shown {
  std::vector<double> values;
  ColorScale scale;
  Chart chart;
};

bool IsPosed(const Options& options) {
  return !options.session.empty() || !options.pose.empty() ||
         !options.motion.empty();
}

absl::Status CheckOptions(const Options& options) {
  if (options.png.empty()) return absl::OkStatus();
  if (options.stage.model_file.empty()) {
    return UsageError("--png needs --model-file, for the faces to draw");
  }
  if (options.color != "influence" && !IsPosed(options)) {
    return UsageError(
        absl::StrCat("--color ", options.color,
                     " needs a pose: --pose, --motion or --session"));
  }
  return absl::OkStatus();
}

// Binds, or finds the binding of the session.
absl::StatusOr<std::unique_ptr<Stage>> OpenStage(const Options& options,
                                                 Context& context) {
  StageOptions stage = options.stage;
  if (!options.session.empty()) {
    DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
    DEFORM_ASSIGN_OR_RETURN(const SessionInfo session,
                            client.GetSession(options.session));
    stage.binding = session.binding_id;
  }
  return Stage::Open(context, stage);
}

// Nothing without a pose. Of a session, its pose as it is now.
absl::StatusOr<std::optional<PoseUpdate>> PoseOf(const Options& options,
                                                 Stage& stage) {
  PoseUpdate update{.stretch_blend = options.blend};
  if (!options.session.empty()) {
    DEFORM_ASSIGN_OR_RETURN(DeformStream stream,
                            stage.client().Deform(options.session));
    update.positions = stream.joined().pose.vertices;
    update.stretch_blend = stream.joined().pose.stretch_blend;
  } else if (!options.pose.empty()) {
    DEFORM_ASSIGN_OR_RETURN(update.positions, stage.LoadPose(options.pose));
  } else if (!options.motion.empty()) {
    DEFORM_ASSIGN_OR_RETURN(update.positions,
                            PoseOfMotion(options.motion, stage.rig().vertices,
                                         stage.rig().dimension, options.at));
  } else {
    return std::optional<PoseUpdate>();
  }
  return std::optional(std::move(update));
}

absl::StatusOr<QualityInfo> Measure(const Options& options, Context& context,
                                    Stage& stage,
                                    const std::optional<PoseUpdate>& pose) {
  const int64_t points = stage.binding().point_count;
  QualityQuery query{.binding_id = stage.binding().binding_id,
                     .max_points = options.max_points};
  if (options.png.empty() && !options.session.empty()) {
    query.session_id = options.session;
  } else {
    // The picture shows the pose that is measured.
    query.pose = pose;
  }
  if (!options.png.empty() && pose) {
    // Every point has its colour.
    query.max_points = std::min(points, kMostMeasuredPoints);
    query.with_points = true;
  }
  Progress measuring(context.console, "measuring", &context.interruption);
  return stage.client().GetQuality(query, measuring.callback());
}

absl::StatusOr<Shown> ShownOf(const Options& options, Stage& stage,
                              const QualityInfo& quality,
                              const Positions& deformed) {
  const Positions& rest = stage.model()->positions;
  Shown shown;
  if (options.color == "influence") {
    const bool of_face = options.face >= 0;
    DEFORM_ASSIGN_OR_RETURN(shown.values,
                            of_face ? stage.InfluenceOfFace(options.face)
                                    : stage.InfluenceOfVertex(options.handle));
    shown.scale = LinearScale(
        shown.values,
        of_face ? absl::StrCat("weight of the normal of face ", options.face)
                : absl::StrCat("weight of vertex ", options.handle));
  } else if (options.color == "displacement") {
    shown.values = DisplacementOf(rest, deformed);
    shown.scale = LinearScale(shown.values, "displacement, model units");
  } else if (options.color == "volume") {
    const PoseQuality& pose = *quality.pose;
    shown.values = VolumeChangeOf(pose, rest.rows());
    shown.scale = VolumeScale(pose.volume_change_min, pose.volume_change_max);
  } else {
    const PoseQuality& pose = *quality.pose;
    shown.values = DistortionOf(pose, rest.rows());
    shown.scale = DistortionScale(pose.distortion_max);
  }
  shown.chart = ValueChart(shown.values, shown.scale);
  return shown;
}

std::string CaptionOf(const Stage& stage, const QualityInfo& quality) {
  std::string caption =
      absl::StrCat(stage.binding().scheme, ", ",
                   Thousands(stage.binding().point_count), " points");
  if (quality.pose) {
    absl::StrAppend(&caption, "\ndistortion ", DistortionText(*quality.pose));
    if (quality.pose->fold_overs > 0) {
      absl::StrAppend(&caption, "\n", Thousands(quality.pose->fold_overs),
                      " fold-overs");
    }
  }
  return caption;
}

absl::Status Draw(const Options& options, Stage& stage,
                  const QualityInfo& quality,
                  const std::optional<PoseUpdate>& pose) {
  Positions deformed = stage.model()->positions;
  if (pose) {
    DEFORM_ASSIGN_OR_RETURN(const Frame frame, stage.DeformOnce(*pose));
    deformed = frame.DoublePositions();
  }
  DEFORM_ASSIGN_OR_RETURN(Shown shown,
                          ShownOf(options, stage, quality, deformed));
  Picture picture;
  picture.dimension = stage.binding().dimension;
  picture.faces = stage.model()->faces;
  picture.rig_faces = stage.rig().faces;
  picture.scale = shown.scale;
  picture.panels = {{.caption = CaptionOf(stage, quality),
                     .positions = deformed,
                     .rig = pose ? pose->positions : stage.rig().vertices,
                     .values = shown.values}};
  DEFORM_ASSIGN_OR_RETURN(const Image model,
                          DrawImage(options.picture, std::move(picture)));
  shown.chart.width = model.width;
  shown.chart.height = std::max(200, model.height / 4);
  return SavePng(Stacked({model, DrawScale(shown.scale, model.width, 84),
                          DrawChart(shown.chart)}),
                 options.png);
}

absl::Status Run(const Options& options, Context& context) {
  DEFORM_RETURN_IF_ERROR(CheckOptions(options));
  DEFORM_ASSIGN_OR_RETURN(const std::unique_ptr<Stage> stage,
                          OpenStage(options, context));
  DEFORM_ASSIGN_OR_RETURN(const std::optional<PoseUpdate> pose,
                          PoseOf(options, *stage));
  DEFORM_ASSIGN_OR_RETURN(const QualityInfo quality,
                          Measure(options, context, *stage, pose));
  if (!options.png.empty()) {
    DEFORM_RETURN_IF_ERROR(Draw(options, *stage, quality, pose));
  }
  Json json = {{"binding_id", stage->binding().binding_id},
               {"scheme", stage->binding().scheme},
               {"png", options.png}};
  json["quality"] = ToJson(quality);
  context.console.Result(json, [&](std::ostream& out) {
    Describe(quality, out);
    if (!options.png.empty()) out << "wrote " << options.png << "\n";
  });
  return stage->Close();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  auto* const session =
      app.add_option("--session", options->session,
                     "Report on the present pose of this session")
          ->type_name("SESSION");
  auto* const pose =
      app.add_option("--pose", options->pose,
                     "Report on a pose: a file with the rig's vertices, moved")
          ->type_name("FILE")
          ->excludes(session);
  app.add_option("--motion", options->motion,
                 absl::StrCat("Report on a moment of a built-in motion: ",
                              MotionList()))
      ->check(CLI::IsMember(MotionNames()))
      ->excludes(session)
      ->excludes(pose);
  app.add_option("--at", options->at, "Time of the motion, from 0 to 1")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--blend", options->blend,
                 "Stretch blend: 1 distorts least, 0 stretches freely")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--max-points", options->max_points,
                 "Judge a larger model by a sample of so many points; 0: the "
                 "server's default")
      ->check(CLI::Range(int64_t{0}, kMostMeasuredPoints))
      ->capture_default_str();
  app.add_option("--png", options->png,
                 "Picture of the model in colours, with a histogram")
      ->type_name("FILE");
  app.add_option("--color", options->color, "What the colours show")
      ->check(
          CLI::IsMember({"distortion", "volume", "displacement", "influence"}))
      ->capture_default_str();
  app.add_option("--handle", options->handle,
                 "For influence: which vertex of the rig")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--face", options->face,
                 "For influence: the normal of a face of the cage instead")
      ->check(CLI::NonNegativeNumber)
      ->excludes("--handle");
  options->stage.AddTo(app);
  options->picture.AddTo(app);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& ReportCommand() {
  static const Command command = {
      "report", "Report on the quality of a binding, and of a pose",
      "deformctl report --binding $binding\n"
      "deformctl report --binding $binding --pose posed.obj --json\n"
      "deformctl report --session $session --model-file a.obj --png a.png\n"
      "deformctl report --model-file a.obj --cage c.obj --motion twist "
      "--png a.png --color volume\n"
      "deformctl report --model-file a.obj --handles h.obj --png a.png "
      "--color influence --handle 3",
      "", Setup};
  return command;
}

}  // namespace deform::cli
