// A deformd server, as seen from a program.
//
//   auto client = deform::Client::Connect("127.0.0.1:7777").value();
//   auto model = client.RegisterModel(mesh, "bunny").value();
//   auto binding = client.CreateBinding({.model_id = model.model_id,
//                                        .rig = cage}).value();
//   auto session = client.CreateSession(binding.binding_id).value();
//   auto stream = client.Deform(session.session_id).value();
//   stream.Send({.positions = posed_cage_vertices}).value();
//   deform::Frame frame;
//   while (stream.NextFrame(frame).ok()) Draw(frame.DoublePositions());
//
// Errors are the server's: code and message, and in DetailOf(status)
// (core/base/error.h) the stable reason, the field to mend, the resource. A
// server that cannot be reached is Unavailable with the reason
// SERVER_UNREACHABLE.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "client/cpp/arrays.h"
#include "client/cpp/deform_stream.h"
#include "client/cpp/info.h"
#include "core/weights/handle_edit.h"

namespace deform {

class DeformCall;
class DeformEvents;

struct ClientOptions {
  // Separates the data of those who share a server; empty means "default".
  std::string tenant;
  // How long Connect() waits for the server.
  std::chrono::milliseconds connect_timeout{5000};
  // How long a call without work behind it may take (all but RegisterModel,
  // CreateBinding, GetWeights, GetQuality, Deform and downloads, which take as
  // long as they need).
  std::chrono::milliseconds call_timeout{30000};
  // Clients of one server in one program share a connection, unless they want
  // one of their own.
  bool own_connection = false;
};

enum class WeightPrecision {
  kCachedFloat32,      // What deforming uses.
  kRecomputedFloat64,  // Computed again from the rig.
};

// Weights of the consecutive points from `first_point` on.
struct WeightRows {
  int64_t first_point = 0;
  RowMatrix vertex;  // rows x V; rows of unbound points are 0.
  RowMatrix normal;  // rows x normal_count, model units.
};

// What GetQuality() is to judge.
struct QualityQuery {
  std::string binding_id;
  // One of them, or neither: then only the binding is reported on.
  std::optional<PoseUpdate> pose;  // Vertices that are not named rest.
  std::string session_id;          // Its present pose.
  // A model with more points is judged by a sample; 0: the server's default.
  int64_t max_points = 0;
  // Also fetch the values of the points measured.
  bool with_points = false;
};

// Done and total: bytes of a download, points of a binding or a report. Called
// on the calling thread. False gives up: the server stops and the call returns
// Cancelled.
using ProgressCallback = std::function<bool(int64_t done, int64_t total)>;

struct EditOptions {
  std::vector<std::string> sessions;  // Those that move; empty: all.
  bool keep_sessions = false;         // None moves.
};

// Thread-safe: one client serves all threads. Cheap to copy; copies share a
// connection, which comes back by itself when the server does.
class Client {
 public:
  // `target` is HOST:PORT or unix:PATH. The connection is not encrypted: for
  // loopback, Unix sockets and trusted networks.
  static absl::StatusOr<Client> Connect(absl::string_view target,
                                        const ClientOptions& options = {});

  // Uploads `model` in chunks of at most 1 MiB. Vertex order is kept for ever.
  // Registering the same arrays again finds the model that is there.
  absl::StatusOr<ModelInfo> RegisterModel(
      const ModelArrays& model, absl::string_view display_name,
      const ProgressCallback& progress = {});
  absl::StatusOr<ModelInfo> GetModel(absl::string_view model_id);
  // The arrays of a model as they were registered, faces included.
  absl::StatusOr<ModelArrays> DownloadModel(
      absl::string_view model_id, const ProgressCallback& progress = {});
  absl::StatusOr<std::vector<ModelInfo>> ListModels();
  absl::Status DeleteModel(absl::string_view model_id);

  // Returns when the weights are computed, or at once if they are there.
  absl::StatusOr<BindingInfo> CreateBinding(
      const BindingSpec& spec, const ProgressCallback& progress = {});
  // Adds, moves at rest and removes handles of a binding: computes the binding
  // of the edited handles and has sessions move over to it, all of the old one
  // or those that are named. If the edited rig is refused, nothing changes.
  absl::StatusOr<EditedBinding> EditHandles(
      absl::string_view binding_id, std::span<const HandleEdit> edits,
      const EditOptions& options = {}, const ProgressCallback& progress = {});
  absl::StatusOr<BindingInfo> GetBinding(absl::string_view binding_id);
  // The rig of a binding at rest.
  absl::StatusOr<RigArrays> GetRig(absl::string_view binding_id);
  // Of one model, or of all if `model_id` is empty.
  absl::StatusOr<std::vector<BindingInfo>> ListBindings(
      absl::string_view model_id = "");
  absl::Status DeleteBinding(absl::string_view binding_id);

  // Passes the weights of `count` points from `first` on (0: up to the last),
  // in order, to `rows`. An error that `rows` returns ends the call with it.
  absl::Status GetWeights(
      absl::string_view binding_id, WeightPrecision precision, int64_t first,
      int64_t count, absl::FunctionRef<absl::Status(const WeightRows&)> rows);

  // The model, the rig and the weights of a binding, to deform by oneself
  // (core/deform/deformer.h) or to receive poses instead of frames
  // (DeformOptions::weights). N x C floats; CompressBinding() makes them fewer.
  absl::StatusOr<HeldBinding> DownloadBinding(
      absl::string_view binding_id, const ProgressCallback& progress = {});

  // The leaf basis of a binding's compressed weights, to receive leaf
  // coefficients instead of frames (DeformOptions::basis). Waits while weights
  // are being compressed. `known` is given back if the server has it still:
  // then nothing is downloaded. FailedPrecondition NO_BASIS if weights stay
  // dense.
  absl::StatusOr<HeldBasis> DownloadBasis(absl::string_view binding_id,
                                          const ProgressCallback& progress = {},
                                          const HeldBasis& known = {});

  // How a binding came out, and what a pose does to its model.
  absl::StatusOr<QualityInfo> GetQuality(const QualityQuery& query,
                                         const ProgressCallback& progress = {});

  absl::StatusOr<std::vector<SchemeInfo>> ListSchemes();

  // `session_id`: 1 to 64 of [A-Za-z0-9_-], or empty for one of the server's.
  absl::StatusOr<SessionInfo> CreateSession(absl::string_view binding_id,
                                            absl::string_view session_id = "");
  absl::StatusOr<SessionInfo> GetSession(absl::string_view session_id);
  absl::StatusOr<std::vector<SessionInfo>> ListSessions();
  absl::Status DeleteSession(absl::string_view session_id);

  // What the server holds, has done, and costs.
  absl::StatusOr<ServerStatus> GetServerStatus();
  // Has the server copy all that it stores; returns where, on its machine.
  absl::StatusOr<std::string> Backup(absl::string_view name);

  // Joins a session: poses in, frames out.
  absl::StatusOr<DeformStream> Deform(absl::string_view session_id,
                                      const DeformOptions& options);
  absl::StatusOr<DeformStream> Deform(absl::string_view session_id,
                                      Delivery delivery = Delivery::kLatest);
  // The same without a thread that waits, for programs with many streams
  // (deform_call.h). `events` is borrowed.
  std::unique_ptr<DeformCall> StartDeform(absl::string_view session_id,
                                          const DeformOptions& options,
                                          DeformEvents& events);

 private:
  struct Impl;
  explicit Client(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

  // Until the weights stay in the form that they have.
  absl::Status AwaitForm(absl::string_view binding_id,
                         const ProgressCallback& progress);

  std::shared_ptr<Impl> impl_;
};

}  // namespace deform
