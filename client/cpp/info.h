// What the server tells about the things it keeps.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/mesh/types.h"
#include "core/quality/pose_quality.h"
#include "core/weights/bind_quality.h"

namespace deform {

using WallTime = std::chrono::system_clock::time_point;

struct ModelInfo {
  std::string model_id;  // Content address.
  std::string display_name;
  int dimension = 0;
  int64_t vertex_count = 0;
  int64_t face_count = 0;
  std::vector<double> box_min;  // `dimension` numbers.
  std::vector<double> box_max;
  WallTime create_time;
  // From RegisterModel only: it was registered before.
  bool existed = false;
};

// Points that could not be bound; they rest where they are in every pose.
struct UnboundInfo {
  std::string reason;  // "EXTERIOR_NO_EXIT_FACE"
  std::vector<int64_t> points;
};

// A connected part of the model outside the cage.
struct ExitPartInfo {
  int64_t exit_face = 0;
  int64_t point_count = 0;
  int64_t first_point = 0;
  std::vector<int64_t> crossed_faces;
};

// Where the weights of a binding are; evicted ones are computed again when
// somebody needs them.
enum class WeightState { kUnknown, kResident, kEvicted, kComputing };

// kCompressing: dense, and being compressed or waiting for that.
enum class WeightForm { kUnknown, kDense, kCompressing, kCompressed };

struct BindingInfo {
  std::string binding_id;  // Content address.
  std::string model_id;
  std::string scheme;
  int dimension = 0;
  int64_t point_count = 0;
  int64_t vertex_count = 0;  // Rows of a pose.
  int64_t normal_count = 0;  // Weight columns of face normals.
  double rig_diagonal = 0;   // D, model units.
  int64_t weight_bytes = 0;  // Memory of the weights while they are resident.
  WeightState weight_state = WeightState::kUnknown;
  WeightForm weight_form = WeightForm::kUnknown;
  double weight_tolerance = 0;  // As asked; 0: dense.
  // Of compressed weights: no point of the model is farther off than this times
  // the pose's largest displacement, in units of D.
  double weight_error_bound = 0;
  int64_t dense_weight_bytes = 0;  // If they were dense.
  double compression_ratio = 0;    // That by weight_bytes.
  std::string why_dense;           // In spite of the tolerance.
  // Of kComputing, or else of kCompressing.
  int64_t points_done = 0;
  int64_t points_total = 0;
  int weight_users = 0;  // Sessions and calls; they keep the weights resident.
  WallTime last_use_time;
  double compute_seconds = 0;
  BindQuality quality;
  int64_t unbound_count = 0;
  std::vector<UnboundInfo> unbound;
  int64_t clamped_count = 0;
  std::vector<int64_t> clamped;  // Points held at rest on request, sorted.
  std::vector<ExitPartInfo> exit_parts;
  int64_t fixed_handle_count = 0;  // Handles that no pose moves.
  std::vector<std::string> warnings;
  WallTime create_time;
  // From CreateBinding only: it was there before.
  bool existed = false;
};

// Figures as core/quality computes them; their units and limits are told there.
struct QualityInfo {
  BindQuality binding;
  double rig_distance_min = 0;  // Of a bound point, in units of D.
  // If a pose was named. Its points only if they were asked for.
  std::optional<PoseQuality> pose;
  int64_t points_measured = 0;
};

// A session that has moved to a binding of edited handles.
struct MovedSession {
  std::string session_id;
  uint64_t revision = 0;    // Its first with the new binding.
  double largest_jump = 0;  // Of any point of the model, in units of D.
};

struct EditedBinding {
  BindingInfo binding;
  // Of each row of a pose: which row of the old binding's it was, or -1.
  std::vector<int32_t> previous;
  // Newton steps a point of the new binding, and of the old one.
  double iterations_mean = 0;
  double iterations_mean_before = 0;
  std::vector<MovedSession> moved;
  // Sessions that did not move, with the reason.
  std::vector<std::pair<std::string, absl::Status>> not_moved;
};

struct SessionInfo {
  std::string session_id;
  std::string binding_id;
  uint64_t revision = 0;  // 0 is the rest pose.
  // What outlives the server of it; 0 if it keeps nothing.
  uint64_t durable_revision = 0;
  uint64_t epoch = 0;
  int participant_count = 0;
  WallTime create_time;
};

// The server itself; the fields are told in deform/v1/server.proto.
struct ServerStatus {
  std::string version;
  double uptime_seconds = 0;
  double cpu_seconds = 0;
  int64_t resident_bytes = 0;
  int open_files = 0;
  int processors = 0;
  int64_t models = 0;
  int64_t bindings = 0;
  int64_t sessions = 0;
  int64_t participants = 0;
  int64_t frames_sent = 0;
  int64_t frame_bytes_sent = 0;
  int64_t poses_accepted = 0;
  int64_t poses_rejected = 0;
};

struct SchemeInfo {
  std::string scheme;
  std::string description;
  bool takes_cage = false;  // Else handles.
  bool uses_normals = false;
};

}  // namespace deform
