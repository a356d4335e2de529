// A session to pose a model in, and what it stands on.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/command.h"
#include "client/cli/rig_options.h"
#include "core/files/mesh_file.h"

namespace deform::cli {

struct StageOptions {
  std::string model_file;
  std::string binding;  // Or a rig.
  RigOptions rig;
  bool keep = false;

  void AddTo(CLI::App& app);
};

// Registers, binds and opens a session, or opens a session of a binding that is
// there. Not thread-safe.
class Stage {
 public:
  // Errors of files, arguments and the server; Cancelled on Ctrl-C, which from
  // now on waits for things to be tidied up.
  static absl::StatusOr<std::unique_ptr<Stage>> Open(
      Context& context, const StageOptions& options);
  // Deletes what Open() made, if Close() was not called.
  ~Stage();

  Client& client() { return client_; }
  const BindingInfo& binding() const { return binding_; }
  const SessionInfo& session() const { return session_; }
  const RigArrays& rig() const { return rig_; }
  // The model's file, if one was given.
  const std::optional<MeshFile>& model() const { return model_; }

  // The frame of one pose of the session.
  absl::StatusOr<Frame> DeformOnce(const PoseUpdate& pose,
                                   const DeformOptions& options = {
                                       .delivery = Delivery::kEvery});

  // At every point the weight of a vertex of the rig, or of the normal of a
  // face. A usage error if there is none.
  absl::StatusOr<std::vector<double>> InfluenceOfVertex(int64_t vertex);
  absl::StatusOr<std::vector<double>> InfluenceOfFace(int64_t face);

  // The posed rig that a file holds.
  absl::StatusOr<Positions> LoadPose(const std::string& path) const;

  // The bytes of the deformed model for a file at `path`: with the extension of
  // the model's file that file with its positions replaced, as .obj the bare
  // geometry. A usage error otherwise.
  absl::StatusOr<std::string> FileWith(const Positions& positions,
                                       const std::string& path) const;

  // Deletes what Open() made: always the session, and unless it is to be kept
  // the binding and the model.
  absl::Status Close();

 private:
  // Of the vertex weights followed by the normal weights.
  absl::StatusOr<std::vector<double>> WeightColumn(int64_t column);

  explicit Stage(Client client) : client_(std::move(client)) {}
  absl::Status Bind(Context& context, const StageOptions& options);
  absl::Status UseBinding(const StageOptions& options);

  Client client_;
  std::optional<MeshFile> model_;
  RigArrays rig_;
  BindingInfo binding_;
  SessionInfo session_;
  // What is to be deleted; empty if it is not ours.
  std::string our_model_;
  std::string our_binding_;
  std::string our_session_;
};

}  // namespace deform::cli
