#include "client/cli/load_stage.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "client/cli/motion.h"
#include "client/cli/progress.h"
#include "client/load/load_model.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {
namespace {

constexpr size_t kMaxPoses = 10000;
constexpr double kBendSeconds = 2;  // There and back.

// Folders are taken as their files, by name.
absl::StatusOr<std::vector<std::string>> FilesOf(
    const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) {
      files.push_back(path);
      continue;
    }
    std::vector<std::string> within;
    for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
      if (entry.is_regular_file()) within.push_back(entry.path().string());
    }
    std::sort(within.begin(), within.end());
    files.insert(files.end(), within.begin(), within.end());
  }
  if (!files.empty() && files.size() <= kMaxPoses) return files;
  return UsageError(
      absl::StrCat("--poses: ", files.size(), " files, not 1 to ", kMaxPoses));
}

absl::StatusOr<std::vector<Positions>> Recorded(
    const std::vector<std::string>& paths, const Rig& rig) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<std::string> files, FilesOf(paths));
  std::vector<Positions> poses;
  for (const std::string& path : files) {
    DEFORM_ASSIGN_OR_RETURN(const MeshFile file,
                            LoadMesh(path, ToFileDimension(DimensionOf(rig))));
    if (file.positions.rows() != PoseRows(rig)) {
      return WithExit(
          kBadFile,
          InvalidInput("WRONG_LENGTH", "",
                       absl::StrCat(path, ": has ", file.positions.rows(),
                                    " vertices, the rig has ", PoseRows(rig))));
    }
    poses.push_back(file.positions);
  }
  return poses;
}

absl::StatusOr<std::vector<Positions>> Bends(const Rig& rig, double rate) {
  const Positions rest = RestVertices(rig).topRows(PoseRows(rig));
  const auto count =
      std::clamp<int64_t>(std::lround(kBendSeconds * rate), 2, 1000);
  std::vector<Positions> poses;
  for (int64_t i = 0; i < count; ++i) {
    const double time = static_cast<double>(i) / static_cast<double>(count);
    DEFORM_ASSIGN_OR_RETURN(Positions pose,
                            PoseOfMotion("bend", rest, DimensionOf(rig), time));
    poses.push_back(std::move(pose));
  }
  return poses;
}

absl::StatusOr<PosePattern> MakePattern(const LoadStageOptions& options,
                                        const Rig& rig) {
  using Kind = PosePattern::Kind;
  if (options.editors > PoseRows(rig)) {
    return UsageError(absl::StrCat("--editors ", options.editors,
                                   ": each needs vertices of its own, and the "
                                   "rig has ",
                                   PoseRows(rig)));
  }
  const auto pattern = [&](Kind kind, std::vector<Positions> poses) {
    return PosePattern(kind, rig, options.editors, options.rate,
                       std::move(poses));
  };
  if (options.pattern == "drag") return pattern(Kind::kDrag, {});
  if (options.pattern == "jitter") return pattern(Kind::kJitter, {});
  const bool recorded = options.pattern == "recorded";
  DEFORM_ASSIGN_OR_RETURN(
      std::vector<Positions> poses,
      recorded ? Recorded(options.poses, rig) : Bends(rig, options.rate));
  return pattern(Kind::kSequence, std::move(poses));
}

// Compressed weights are off by their tolerance times a displacement, which is
// no larger than the rig, at rest or posed: the unit of FrameJudge.
double Allowed(const LoadStageOptions& options, const BindingInfo& binding) {
  return options.tolerance + binding.weight_tolerance + options.frame_tolerance;
}

}  // namespace

const std::vector<std::string>& LoadPatterns() {
  static const auto& patterns =
      *new std::vector<std::string>{"drag", "jitter", "whole", "recorded"};
  return patterns;
}

LoadStage::~LoadStage() {
  // The error that brought us here says more than one that may come now.
  Close().IgnoreError();
}

absl::Status LoadStage::Close() { return created_.DeleteAll(client_); }

absl::Status LoadStage::Prepare(Context& context,
                                const LoadStageOptions& options) {
  if (!options.binding.empty()) return UseBinding(options);
  for (int64_t number = 0; number < options.models; ++number) {
    DEFORM_RETURN_IF_ERROR(Generate(context, options, number));
  }
  return absl::OkStatus();
}

absl::Status LoadStage::Generate(Context& context,
                                 const LoadStageOptions& options,
                                 int64_t number) {
  LoadModel made = MakeLoadModel(options.points, options.cage_faces,
                                 options.handles, number);
  Progress uploading(context.console, "uploading", &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(
      const ModelInfo model,
      client_.RegisterModel(made.model, absl::StrCat("load ", number),
                            uploading.callback()));
  created_.Add(model);
  made.spec.model_id = model.model_id;
  Progress binding(context.console, "computing weights", &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo info,
                          client_.CreateBinding(made.spec, binding.callback()));
  created_.Add(info);
  std::shared_ptr<const FrameJudge> judge;
  if (options.check) {
    DEFORM_ASSIGN_OR_RETURN(
        FrameJudge own,
        FrameJudge::FromModel(made.model, made.spec, Allowed(options, info)));
    judge = std::make_shared<const FrameJudge>(std::move(own));
  }
  DEFORM_ASSIGN_OR_RETURN(const Rig rig, RigOf(made.spec.rig));
  return AddTarget(options, info, rig, std::move(judge));
}

absl::Status LoadStage::UseBinding(const LoadStageOptions& options) {
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo info,
                          client_.GetBinding(options.binding));
  DEFORM_ASSIGN_OR_RETURN(const RigArrays arrays,
                          client_.GetRig(options.binding));
  DEFORM_ASSIGN_OR_RETURN(const Rig rig, RigOf(arrays));
  std::shared_ptr<const FrameJudge> judge;
  if (options.check) {
    DEFORM_ASSIGN_OR_RETURN(
        FrameJudge asked,
        FrameJudge::FromServer(client_, info, rig, Allowed(options, info)));
    judge = std::make_shared<const FrameJudge>(std::move(asked));
  }
  return AddTarget(options, info, rig, std::move(judge));
}

absl::Status LoadStage::AddTarget(const LoadStageOptions& options,
                                  const BindingInfo& binding, const Rig& rig,
                                  std::shared_ptr<const FrameJudge> judge) {
  DEFORM_ASSIGN_OR_RETURN(PosePattern pattern, MakePattern(options, rig));
  scheme_ = binding.scheme;
  columns_ =
      binding.vertex_count + binding.fixed_handle_count + binding.normal_count;
  targets_.push_back(
      {.binding_id = binding.binding_id,
       .point_count = binding.point_count,
       .pattern = std::make_shared<const PosePattern>(std::move(pattern)),
       .judge = std::move(judge)});
  if (options.hold_weights) {
    DEFORM_ASSIGN_OR_RETURN(targets_.back().weights,
                            client_.DownloadBinding(binding.binding_id));
  }
  if (options.hold_basis) {
    DEFORM_ASSIGN_OR_RETURN(targets_.back().basis,
                            client_.DownloadBasis(binding.binding_id));
  }
  return absl::OkStatus();
}

}  // namespace deform::cli
