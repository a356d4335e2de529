#include "client/cli/stage.h"

#include <CLI/CLI.hpp>
#include <filesystem>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "client/cli/exit_code.h"
#include "client/cli/files.h"
#include "client/cli/progress.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::cli {

void StageOptions::AddTo(CLI::App& app) {
  app.add_option("--model-file", model_file, "Model: OBJ, OFF, PLY or STL")
      ->type_name("FILE");
  auto* const binding_option =
      app.add_option("--binding", binding,
                     "Use this binding instead of binding the model to a rig")
          ->type_name("BINDING");
  app.add_flag(
      "--keep", keep,
      "Leave model and binding on the server: the next call is faster");
  rig.AddTo(app);
  binding_option->excludes("--cage")->excludes("--handles");
}

absl::StatusOr<std::unique_ptr<Stage>> Stage::Open(
    Context& context, const StageOptions& options) {
  if (options.binding.empty() &&
      (options.model_file.empty() || !options.rig.given())) {
    return UsageError(
        "say what is to be deformed: --model-file FILE with --cage FILE or "
        "--handles FILE, or --binding BINDING");
  }
  context.interruption.expected = true;
  std::optional<MeshFile> model;
  if (!options.model_file.empty()) {
    DEFORM_ASSIGN_OR_RETURN(
        model,
        LoadMesh(options.model_file, ToFileDimension(options.rig.dimension)));
  }
  DEFORM_ASSIGN_OR_RETURN(Client client, context.Connect());
  std::unique_ptr<Stage> stage(new Stage(std::move(client)));
  stage->model_ = std::move(model);
  DEFORM_RETURN_IF_ERROR(options.binding.empty() ? stage->Bind(context, options)
                                                 : stage->UseBinding(options));
  stage->our_binding_ = options.keep ? "" : stage->our_binding_;
  stage->our_model_ = options.keep ? "" : stage->our_model_;
  DEFORM_ASSIGN_OR_RETURN(stage->session_, stage->client_.CreateSession(
                                               stage->binding_.binding_id));
  stage->our_session_ = stage->session_.session_id;
  return stage;
}

absl::Status Stage::Bind(Context& context, const StageOptions& options) {
  DEFORM_ASSIGN_OR_RETURN(const int dimension,
                          ChooseDimension(options.rig, model_->dimension));
  if (dimension != model_->dimension) {
    DEFORM_ASSIGN_OR_RETURN(
        model_, LoadMesh(options.model_file, ToFileDimension(dimension)));
  }
  DEFORM_ASSIGN_OR_RETURN(BindingSpec spec, LoadSpec(options.rig, dimension));
  Progress uploading(context.console, "uploading", &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(
      const ModelInfo model,
      client_.RegisterModel(
          {dimension, model_->positions, model_->faces},
          std::filesystem::path(options.model_file).filename().string(),
          uploading.callback()));
  if (!model.existed) our_model_ = model.model_id;
  spec.model_id = model.model_id;
  Progress binding(context.console, "computing weights", &context.interruption);
  DEFORM_ASSIGN_OR_RETURN(binding_,
                          client_.CreateBinding(spec, binding.callback()));
  if (!binding_.existed) our_binding_ = binding_.binding_id;
  rig_ = std::move(spec.rig);
  return absl::OkStatus();
}

absl::Status Stage::UseBinding(const StageOptions& options) {
  DEFORM_ASSIGN_OR_RETURN(binding_, client_.GetBinding(options.binding));
  DEFORM_ASSIGN_OR_RETURN(rig_, client_.GetRig(options.binding));
  if (!model_) return absl::OkStatus();
  DEFORM_ASSIGN_OR_RETURN(
      model_,
      LoadMesh(options.model_file, ToFileDimension(binding_.dimension)));
  if (model_->positions.rows() == binding_.point_count) return absl::OkStatus();
  return WithExit(
      kBadFile, InvalidInput("WRONG_LENGTH", "",
                             absl::StrCat(options.model_file, ": has ",
                                          model_->positions.rows(),
                                          " vertices, the binding's model has ",
                                          binding_.point_count)));
}

Stage::~Stage() {
  // The error that brought us here says more than one that may come now.
  Close().IgnoreError();
}

absl::StatusOr<Frame> Stage::DeformOnce(const PoseUpdate& pose,
                                        const DeformOptions& options) {
  DEFORM_ASSIGN_OR_RETURN(DeformStream stream,
                          client_.Deform(session_.session_id, options));
  DEFORM_ASSIGN_OR_RETURN(const uint64_t sequence, stream.Send(pose));
  Frame frame;
  do {
    DEFORM_RETURN_IF_ERROR(stream.NextFrame(frame));
  } while (frame.answers_sequence < sequence);
  return frame;
}

absl::StatusOr<std::vector<double>> Stage::InfluenceOfVertex(int64_t vertex) {
  if (vertex < binding_.vertex_count) return WeightColumn(vertex);
  return UsageError(absl::StrCat("--handle ", vertex, ": the rig has ",
                                 binding_.vertex_count, " vertices"));
}

absl::StatusOr<std::vector<double>> Stage::InfluenceOfFace(int64_t face) {
  if (face < binding_.normal_count) {
    return WeightColumn(binding_.vertex_count + face);
  }
  return UsageError(absl::StrCat("--face ", face, ": scheme ", binding_.scheme,
                                 " has weights of ", binding_.normal_count,
                                 " normals"));
}

absl::StatusOr<std::vector<double>> Stage::WeightColumn(int64_t column) {
  std::vector<double> values(binding_.point_count);
  DEFORM_RETURN_IF_ERROR(client_.GetWeights(
      binding_.binding_id, WeightPrecision::kCachedFloat32, 0, 0,
      [&](const WeightRows& rows) {
        const int64_t normal = column - rows.vertex.cols();
        for (int64_t i = 0; i < rows.vertex.rows(); ++i) {
          values.at(rows.first_point + i) =
              normal < 0 ? rows.vertex(i, column) : rows.normal(i, normal);
        }
        return absl::OkStatus();
      }));
  return values;
}

absl::StatusOr<Positions> Stage::LoadPose(const std::string& path) const {
  DEFORM_ASSIGN_OR_RETURN(const MeshFile file,
                          LoadMesh(path, ToFileDimension(rig_.dimension)));
  if (file.positions.rows() == rig_.vertices.rows()) return file.positions;
  return WithExit(
      kBadFile, InvalidInput("WRONG_LENGTH", "",
                             absl::StrCat(path, ": has ", file.positions.rows(),
                                          " vertices, the rig has ",
                                          rig_.vertices.rows())));
}

absl::StatusOr<std::string> Stage::FileWith(const Positions& positions,
                                            const std::string& path) const {
  const std::string extension =
      absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  if (model_ && extension == absl::StrCat(".", model_->format)) {
    absl::StatusOr<std::string> bytes = WithPositions(*model_, positions);
    if (!bytes.ok()) return WithExit(kBadFile, bytes.status());
    return bytes;
  }
  if (extension == ".obj") {
    return ObjText(positions, model_ ? model_->faces : Faces(0, 3));
  }
  return UsageError(absl::StrCat(
      path, ": the result can be written as .obj",
      model_ ? absl::StrCat(" or, like its source, as .", model_->format)
             : "; other formats need --model-file"));
}

absl::Status Stage::Close() {
  absl::Status first;
  if (!our_session_.empty()) {
    first.Update(client_.DeleteSession(our_session_));
  }
  if (!our_binding_.empty()) {
    first.Update(client_.DeleteBinding(our_binding_));
  }
  if (!our_model_.empty()) first.Update(client_.DeleteModel(our_model_));
  our_session_.clear();
  our_binding_.clear();
  our_model_.clear();
  return first;
}

}  // namespace deform::cli
