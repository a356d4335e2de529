// deformctl play: a sequence of poses through the stream.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "client/cli/frame_options.h"
#include "client/cli/motion.h"
#include "client/cli/player.h"
#include "client/cli/progress.h"
#include "client/cli/stage.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

struct Options {
  StageOptions stage;
  std::vector<std::string> poses;
  std::string motion;
  int64_t frames = 120;
  std::string delivery = "every";
  double max_fps = 0;
  bool normals = false;
  int in_flight = 4;
  double rate = 0;
  double blend = 1;
  FrameOptions format;
  std::string out_dir;
};

// Poses by number, from 0.
class Script {
 public:
  static absl::StatusOr<Script> Create(const Options& options,
                                       const RigArrays& rig,
                                       const Stage& stage) {
    Script script(options, rig);
    for (const std::string& path : options.poses) {
      DEFORM_ASSIGN_OR_RETURN(Positions pose, stage.LoadPose(path));
      script.loaded_.push_back(std::move(pose));
    }
    return script;
  }

  int64_t size() const {
    return loaded_.empty() ? options_.frames
                           : static_cast<int64_t>(loaded_.size());
  }
  absl::StatusOr<PoseUpdate> Pose(int64_t i) const {
    PoseUpdate update{.stretch_blend = options_.blend};
    if (!loaded_.empty()) {
      update.positions = loaded_[i];
      return update;
    }
    // The last pose is at rest again.
    const double time =
        static_cast<double>(i + 1) / static_cast<double>(options_.frames);
    DEFORM_ASSIGN_OR_RETURN(
        update.positions,
        PoseOfMotion(options_.motion, rig_.vertices, rig_.dimension, time));
    return update;
  }

 private:
  Script(const Options& options, const RigArrays& rig)
      : options_(options), rig_(rig) {}

  const Options& options_;
  const RigArrays& rig_;
  std::vector<Positions> loaded_;
};

absl::Status PrepareDirectory(const std::string& path) {
  if (path.empty()) return absl::OkStatus();
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error) return absl::OkStatus();
  return WithExit(kBadFile,
                  InvalidInput("FILE_NOT_WRITABLE", "",
                               absl::StrCat(path, ": ", error.message())));
}

// "frame_0012.obj" answers the 12th pose.
absl::Status WriteFrame(const Options& options, const Stage& stage,
                        const Frame& frame) {
  if (options.out_dir.empty()) return absl::OkStatus();
  const std::string extension = stage.model() ? stage.model()->format : "obj";
  const std::filesystem::path path =
      std::filesystem::path(options.out_dir) /
      absl::StrFormat("frame_%04d.%s", frame.answers_sequence, extension);
  DEFORM_ASSIGN_OR_RETURN(
      const std::string bytes,
      stage.FileWith(frame.DoublePositions(), path.string()));
  return WriteFile(path.string(), bytes);
}

void Tell(const Options& options, const Stage& stage, const PlayReport& report,
          Console& console) {
  const double seconds = std::max(report.seconds, 1e-9);
  const auto frames = static_cast<double>(std::max<int64_t>(report.frames, 1));
  const double rate = static_cast<double>(report.frames) / seconds;
  const double deform_ms =
      1e-3 * static_cast<double>(report.deform_us) / frames;
  const double columns = static_cast<double>(report.columns_applied) / frames;
  const double bytes_per_frame = static_cast<double>(report.bytes) / frames;
  const Json json = {{"point_count", stage.binding().point_count},
                     {"poses", report.poses_sent},
                     {"frames", report.frames},
                     {"skipped_revisions", report.skipped_revisions},
                     {"seconds", report.seconds},
                     {"frames_per_second", rate},
                     {"latency_ms",
                      {{"p50", report.LatencyMs(0.5)},
                       {"p99", report.LatencyMs(0.99)},
                       {"max", report.LatencyMs(1)}}},
                     {"bytes", report.bytes},
                     {"bytes_per_frame", bytes_per_frame},
                     {"encodings", report.encodings},
                     {"deform_ms", deform_ms},
                     {"columns_applied", columns},
                     {"exit_mismatch_max", report.exit_mismatch_max},
                     {"out_dir", options.out_dir}};
  console.Result(json, [&](std::ostream& out) {
    out << absl::StrFormat(
        "%s poses, %s frames of %s points in %s: %.1f frames/s, %s each, "
        "%s/s\n",
        Thousands(report.poses_sent), Thousands(report.frames),
        Thousands(stage.binding().point_count), Seconds(report.seconds), rate,
        Bytes(static_cast<int64_t>(bytes_per_frame)),
        Bytes(
            static_cast<int64_t>(static_cast<double>(report.bytes) / seconds)));
    out << absl::StrFormat(
        "pose to frame: p50 %.2f ms, p99 %.2f ms, max %.2f ms\n",
        report.LatencyMs(0.5), report.LatencyMs(0.99), report.LatencyMs(1));
    out << absl::StrFormat(
        "server: %.2f ms deforming a frame, %.0f of %d columns applied\n",
        deform_ms, columns,
        stage.binding().vertex_count + stage.binding().normal_count);
    for (const auto& [encoding, count] : report.encodings) {
      out << Thousands(count) << " frames came as " << encoding << "\n";
    }
    if (report.skipped_revisions > 0) {
      out << Thousands(static_cast<int64_t>(report.skipped_revisions))
          << " revisions skipped\n";
    }
    if (!options.out_dir.empty()) out << "wrote " << options.out_dir << "\n";
  });
}

absl::Status Run(const Options& options, Context& context) {
  if (options.poses.empty() == options.motion.empty()) {
    return UsageError("give pose files, or a built-in --motion");
  }
  const bool every = options.delivery == "every";
  if (every && options.max_fps > 0) {
    return UsageError(
        "--max-fps leaves frames out: it needs --delivery latest");
  }
  DEFORM_ASSIGN_OR_RETURN(
      DeformOptions frames,
      options.format.For(every ? Delivery::kEvery : Delivery::kLatest));
  frames.max_fps = options.max_fps;
  frames.normals = options.normals;
  DEFORM_RETURN_IF_ERROR(PrepareDirectory(options.out_dir));
  DEFORM_ASSIGN_OR_RETURN(const std::unique_ptr<Stage> stage,
                          Stage::Open(context, options.stage));
  DEFORM_ASSIGN_OR_RETURN(const Script script,
                          Script::Create(options, stage->rig(), *stage));
  DEFORM_RETURN_IF_ERROR(options.format.Download(
      stage->client(), stage->binding().binding_id, context, frames));
  DEFORM_ASSIGN_OR_RETURN(
      DeformStream stream,
      stage->client().Deform(stage->session().session_id, frames));
  Progress progress(context.console, "playing", &context.interruption);
  const PlayOptions play{.poses = script.size(),
                         .in_flight = options.in_flight,
                         .rate = options.rate,
                         .interrupted = &context.interruption.requested};
  DEFORM_ASSIGN_OR_RETURN(
      const PlayReport report,
      Play(
          stream, play, [&](int64_t i) { return script.Pose(i); },
          [&](const Frame& frame) {
            progress.Show(static_cast<int64_t>(frame.answers_sequence),
                          script.size());
            return WriteFrame(options, *stage, frame);
          }));
  Tell(options, *stage, report, context.console);
  return stage->Close();
}

Action Setup(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("poses", options->poses, "Posed cages or handles, in order")
      ->type_name("FILE");
  app.add_option("--motion", options->motion,
                 absl::StrCat("Instead of files: ", MotionList()))
      ->check(CLI::IsMember(MotionNames()));
  app.add_option("--frames", options->frames, "Poses of the motion")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--delivery", options->delivery,
                 "every: a frame for each pose; latest: the newest state, "
                 "poses may merge")
      ->check(CLI::IsMember({"every", "latest"}))
      ->capture_default_str();
  app.add_option("--max-fps", options->max_fps,
                 "Frames per second, at most, with --delivery latest; 0: as "
                 "they come")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str()
      ->type_name("HZ");
  app.add_flag("--normals", options->normals,
               "Frames with normals of their vertices: two bytes each");
  app.add_option("--in-flight", options->in_flight,
                 "Poses sent ahead of the frames that answer them, at most")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--rate", options->rate,
                 "Poses per second; 0: as fast as frames come")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--blend", options->blend,
                 "Stretch blend: 1 distorts least, 0 stretches freely")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--out-dir", options->out_dir,
                 "Write each frame as a file; without it only figures are told")
      ->type_name("DIR");
  options->format.AddTo(app);
  options->stage.AddTo(app);
  return [options](Context& context) { return Run(*options, context); };
}

}  // namespace

const Command& PlayCommand() {
  static const Command command = {
      "play", "Play poses through the stream and measure it",
      "deformctl play pose_*.obj --model-file a.obj --cage c.obj "
      "--out-dir frames\n"
      "deformctl play --motion twist --model-file a.obj --cage c.obj\n"
      "deformctl play --motion bend --binding $binding --rate 60 "
      "--delivery latest\n"
      "deformctl play --motion bend --binding $binding --frame-tolerance 1e-5",
      "", Setup};
  return command;
}

}  // namespace deform::cli
