#include "client/cpp/convert.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "client/cpp/status.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are sent as they lie in memory");

// Frames hold as many points as the server said at joining; this much memory is
// never asked for at its word.
constexpr uint64_t kMostPoints = uint64_t{1} << 31;

// Beyond 2D and 3D, which the server refuses, three columns are sent.
int Columns(int dimension) { return dimension == 2 ? 2 : 3; }

WallTime FromProto(const google::protobuf::Timestamp& time) {
  return WallTime(std::chrono::duration_cast<WallTime::duration>(
      std::chrono::seconds(time.seconds()) +
      std::chrono::nanoseconds(time.nanos())));
}

absl::Status BadAnswer(absl::string_view what) {
  return InvalidInput("BAD_ANSWER", "",
                      absl::StrCat("the server's answer does not fit: ", what));
}

VolumeKind FromProto(v1::VolumeKind kind) {
  switch (kind) {
    case v1::VOLUME_KIND_CLOSED:
      return VolumeKind::kClosed;
    case v1::VOLUME_KIND_CAPPED:
      return VolumeKind::kCapped;
    case v1::VOLUME_KIND_AREA:
      return VolumeKind::kArea;
    default:
      return VolumeKind::kNone;
  }
}

PoseQuality FromProto(const v1::PoseQuality& quality) {
  const auto& edges = quality.distortion_edges();
  const auto& counts = quality.distortion_counts();
  return {.sampled = quality.sampled(),
          .near_rig = static_cast<int64_t>(quality.near_rig_count()),
          .fixed = static_cast<int64_t>(quality.fixed_count()),
          .distortion_max = quality.distortion_max(),
          .distortion_p99 = quality.distortion_p99(),
          .distortion_median = quality.distortion_median(),
          .most_distorted =
              quality.has_most_distorted_point()
                  ? static_cast<int64_t>(quality.most_distorted_point())
                  : -1,
          .distortion = {{edges.begin(), edges.end()},
                         {counts.begin(), counts.end()}},
          .fold_overs = static_cast<int64_t>(quality.fold_over_count()),
          .volume_change_min = quality.volume_change_min(),
          .volume_change_median = quality.volume_change_median(),
          .volume_change_max = quality.volume_change_max(),
          .volume_kind = FromProto(quality.volume_kind()),
          .volume_rest = quality.volume_rest(),
          .volume_posed = quality.volume_posed()};
}

template <typename Repeated>
void AppendRows(const PositionsRef& rows, int columns, Repeated* out) {
  out->Reserve(static_cast<int>(rows.rows() * columns));
  for (int64_t i = 0; i < rows.rows(); ++i) {
    for (int k = 0; k < columns; ++k) out->Add(rows(i, k));
  }
}

absl::StatusOr<Positions> ReadRows(
    const google::protobuf::RepeatedField<double>& numbers, int dimension) {
  if (dimension != 2 && dimension != 3) return BadAnswer("dimension");
  if (numbers.size() % dimension != 0) return BadAnswer("positions");
  Positions rows = Positions::Zero(numbers.size() / dimension, 3);
  for (int i = 0; i < numbers.size(); ++i) {
    rows(i / dimension, i % dimension) = numbers[i];
  }
  return rows;
}

v1::Rig ToProto(const RigArrays& rig) {
  v1::Rig proto;
  const int columns = Columns(rig.dimension);
  if (rig.kind == RigKind::kHandles) {
    v1::Handles& handles = *proto.mutable_handles();
    handles.set_dimension(static_cast<uint32_t>(rig.dimension));
    AppendRows(rig.vertices, columns, handles.mutable_positions());
    AppendRows(rig.fixed, columns, handles.mutable_fixed_positions());
    return proto;
  }
  v1::Cage& cage = *proto.mutable_cage();
  cage.set_dimension(static_cast<uint32_t>(rig.dimension));
  AppendRows(rig.vertices, columns, cage.mutable_vertices());
  for (const int32_t corner : rig.faces.reshaped<Eigen::RowMajor>()) {
    cage.add_corners(static_cast<uint32_t>(corner));
  }
  return proto;
}

void SetExits(const ExitRegions& exits, v1::CreateBindingRequest& request) {
  switch (exits.kind) {
    case ExitRegions::Kind::kNone:
      return;
    case ExitRegions::Kind::kAutomatic:
      request.mutable_exits()->mutable_automatic();
      return;
    case ExitRegions::Kind::kFaces: {
      auto& faces = *request.mutable_exits()->mutable_faces();
      for (const int32_t face : exits.faces) {
        faces.add_faces(static_cast<uint32_t>(face));
      }
      return;
    }
    case ExitRegions::Kind::kPerPoint: {
      auto& faces = *request.mutable_exits()->mutable_per_point();
      faces.mutable_faces()->Add(exits.face_of_point.begin(),
                                 exits.face_of_point.end());
      return;
    }
  }
}

// Widens rows of `Number`, V and then F to a row, to doubles.
template <typename Number>
void ReadWeights(const v1::GetWeightsResponse& weights, WeightRows& out) {
  using Rows =
      Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows rows(weights.point_count(),
            weights.vertex_count() + weights.normal_count());
  std::memcpy(rows.data(), weights.data().data(), weights.data().size());
  out.vertex = rows.leftCols(weights.vertex_count()).template cast<double>();
  out.normal = rows.rightCols(weights.normal_count()).template cast<double>();
}

WeightState FromProto(v1::WeightState state) {
  switch (state) {
    case v1::WEIGHT_STATE_RESIDENT:
      return WeightState::kResident;
    case v1::WEIGHT_STATE_EVICTED:
      return WeightState::kEvicted;
    case v1::WEIGHT_STATE_COMPUTING:
      return WeightState::kComputing;
    default:
      return WeightState::kUnknown;
  }
}

WeightForm FromProto(v1::WeightForm form) {
  switch (form) {
    case v1::WEIGHT_FORM_DENSE:
      return WeightForm::kDense;
    case v1::WEIGHT_FORM_COMPRESSING:
      return WeightForm::kCompressing;
    case v1::WEIGHT_FORM_COMPRESSED:
      return WeightForm::kCompressed;
    default:
      return WeightForm::kUnknown;
  }
}

}  // namespace

ModelInfo FromProto(const v1::Model& model) {
  return {.model_id = model.model_id(),
          .display_name = model.display_name(),
          .dimension = static_cast<int>(model.dimension()),
          .vertex_count = static_cast<int64_t>(model.vertex_count()),
          .face_count = static_cast<int64_t>(model.face_count()),
          .box_min = {model.box_min().begin(), model.box_min().end()},
          .box_max = {model.box_max().begin(), model.box_max().end()},
          .create_time = FromProto(model.create_time())};
}

BindQuality FromProto(const v1::BindingQuality& quality) {
  return {.reproduction_error = quality.reproduction_error(),
          .partition_error = quality.partition_error(),
          .weight_min = quality.weight_min(),
          .weight_max = quality.weight_max(),
          .weight_sum_max = quality.weight_sum_max(),
          .iterations_total = static_cast<int64_t>(quality.iterations_total()),
          .iterations_max = static_cast<int>(quality.iterations_max()),
          .iterations_mean = quality.iterations_mean(),
          .residual_max = quality.residual_max(),
          .residual_mean = quality.residual_mean()};
}

QualityInfo FromProto(const v1::QualityReport& report) {
  QualityInfo info{.binding = FromProto(report.binding()),
                   .rig_distance_min = report.rig_distance_min()};
  if (report.has_pose()) {
    info.pose = FromProto(report.pose());
    info.points_measured = static_cast<int64_t>(report.pose().point_count());
  }
  return info;
}

absl::Status AddPoints(const v1::QualityPoints& points, QualityInfo& info) {
  if (!info.pose || points.distortion_size() != points.points_size() ||
      points.volume_change_size() != points.points_size()) {
    return BadAnswer("points");
  }
  for (int i = 0; i < points.points_size(); ++i) {
    info.pose->points.push_back({static_cast<int64_t>(points.points(i)),
                                 points.distortion(i),
                                 points.volume_change(i)});
  }
  return absl::OkStatus();
}

BindingInfo FromProto(const v1::Binding& binding) {
  BindingInfo info{
      .binding_id = binding.binding_id(),
      .model_id = binding.model_id(),
      .scheme = binding.scheme(),
      .dimension = static_cast<int>(binding.dimension()),
      .point_count = static_cast<int64_t>(binding.point_count()),
      .vertex_count = binding.vertex_count(),
      .normal_count = binding.normal_count(),
      .rig_diagonal = binding.rig_diagonal(),
      .weight_bytes = static_cast<int64_t>(binding.weight_bytes()),
      .weight_state = FromProto(binding.weight_state()),
      .weight_form = FromProto(binding.weight_form()),
      .weight_tolerance = binding.weight_tolerance(),
      .weight_error_bound = binding.weight_error_bound(),
      .dense_weight_bytes = static_cast<int64_t>(binding.dense_weight_bytes()),
      .compression_ratio = binding.compression_ratio(),
      .why_dense = binding.why_dense(),
      .points_done = static_cast<int64_t>(binding.progress().points_done()),
      .points_total = static_cast<int64_t>(binding.progress().points_total()),
      .weight_users = static_cast<int>(binding.weight_users()),
      .last_use_time = FromProto(binding.last_use_time()),
      .compute_seconds = binding.compute_seconds(),
      .quality = FromProto(binding.quality()),
      .unbound_count = static_cast<int64_t>(binding.unbound_count()),
      .clamped_count = static_cast<int64_t>(binding.clamped_count()),
      .clamped = {binding.clamped_points().begin(),
                  binding.clamped_points().end()},
      .fixed_handle_count = binding.fixed_handle_count(),
      .warnings = {binding.warnings().begin(), binding.warnings().end()},
      .create_time = FromProto(binding.create_time()),
      .existed = binding.existed()};
  for (const v1::UnboundPoints& unbound : binding.unbound()) {
    info.unbound.push_back(
        {unbound.reason(), {unbound.points().begin(), unbound.points().end()}});
  }
  for (const v1::ExitPart& part : binding.exit_parts()) {
    info.exit_parts.push_back(
        {.exit_face = part.exit_face(),
         .point_count = static_cast<int64_t>(part.point_count()),
         .first_point = static_cast<int64_t>(part.first_point()),
         .crossed_faces = {part.crossed_faces().begin(),
                           part.crossed_faces().end()}});
  }
  return info;
}

EditedBinding FromProto(const v1::HandlesEdited& edited) {
  EditedBinding result{
      .binding = FromProto(edited.binding()),
      .previous = {edited.previous_handles().begin(),
                   edited.previous_handles().end()},
      .iterations_mean = edited.iterations_mean(),
      .iterations_mean_before = edited.iterations_mean_before()};
  for (const v1::SessionMoved& moved : edited.moved()) {
    result.moved.push_back({.session_id = moved.session_id(),
                            .revision = moved.revision(),
                            .largest_jump = moved.largest_jump()});
  }
  for (const v1::SessionNotMoved& session : edited.not_moved()) {
    result.not_moved.emplace_back(session.session_id(),
                                  FromRpcStatus(session.status()));
  }
  return result;
}

SessionInfo FromProto(const v1::Session& session) {
  return {.session_id = session.session_id(),
          .binding_id = session.binding_id(),
          .revision = session.revision(),
          .durable_revision = session.durable_revision(),
          .epoch = session.epoch(),
          .participant_count = static_cast<int>(session.participant_count()),
          .create_time = FromProto(session.create_time())};
}

SchemeInfo FromProto(const v1::Scheme& scheme) {
  return {.scheme = scheme.scheme(),
          .description = scheme.description(),
          .takes_cage = scheme.takes_cage(),
          .uses_normals = scheme.uses_normals()};
}

ServerStatus FromProto(const v1::ServerStatus& status) {
  return {.version = status.version(),
          .uptime_seconds = status.uptime_seconds(),
          .cpu_seconds = status.cpu_seconds(),
          .resident_bytes = static_cast<int64_t>(status.resident_bytes()),
          .open_files = static_cast<int>(status.open_files()),
          .processors = static_cast<int>(status.processors()),
          .models = static_cast<int64_t>(status.models()),
          .bindings = static_cast<int64_t>(status.bindings()),
          .sessions = static_cast<int64_t>(status.sessions()),
          .participants = static_cast<int64_t>(status.participants()),
          .frames_sent = static_cast<int64_t>(status.frames_sent()),
          .frame_bytes_sent = static_cast<int64_t>(status.frame_bytes_sent()),
          .poses_accepted = static_cast<int64_t>(status.poses_accepted()),
          .poses_rejected = static_cast<int64_t>(status.poses_rejected())};
}

absl::StatusOr<RigArrays> FromProto(const v1::Rig& rig) {
  RigArrays arrays;
  if (rig.has_handles()) {
    arrays.kind = RigKind::kHandles;
    arrays.dimension = static_cast<int>(rig.handles().dimension());
    DEFORM_ASSIGN_OR_RETURN(
        arrays.vertices, ReadRows(rig.handles().positions(), arrays.dimension));
    DEFORM_ASSIGN_OR_RETURN(
        arrays.fixed,
        ReadRows(rig.handles().fixed_positions(), arrays.dimension));
    return arrays;
  }
  if (!rig.has_cage()) return BadAnswer("no rig");
  const v1::Cage& cage = rig.cage();
  arrays.dimension = static_cast<int>(cage.dimension());
  DEFORM_ASSIGN_OR_RETURN(arrays.vertices,
                          ReadRows(cage.vertices(), arrays.dimension));
  if (cage.corners_size() % arrays.dimension != 0) return BadAnswer("corners");
  arrays.faces.resize(cage.corners_size() / arrays.dimension, arrays.dimension);
  std::copy(cage.corners().begin(), cage.corners().end(), arrays.faces.data());
  DEFORM_RETURN_IF_ERROR(
      CheckIndices(arrays.faces, arrays.vertices.rows(), "rig.cage.corners"));
  return arrays;
}

absl::StatusOr<WeightRows> FromProto(const v1::GetWeightsResponse& weights) {
  const bool wide =
      weights.precision() == v1::WEIGHT_PRECISION_RECOMPUTED_FLOAT64;
  const uint64_t row_bytes =
      (uint64_t{weights.vertex_count()} + weights.normal_count()) *
      (wide ? sizeof(double) : sizeof(float));
  if (row_bytes == 0 || weights.data().size() % row_bytes != 0 ||
      weights.data().size() / row_bytes != weights.point_count()) {
    return BadAnswer("weights");
  }
  WeightRows rows;
  rows.first_point = static_cast<int64_t>(weights.first_point());
  if (wide) {
    ReadWeights<double>(weights, rows);
  } else {
    ReadWeights<float>(weights, rows);
  }
  return rows;
}

absl::StatusOr<JoinedSession> FromProto(const v1::Joined& joined) {
  if (joined.point_count() > kMostPoints) return BadAnswer("point_count");
  JoinedSession result{
      .session_id = joined.session().session_id(),
      .binding_id = joined.session().binding_id(),
      .encoding = joined.encoding(),
      .tolerance = joined.tolerance(),
      .dimension = static_cast<int>(joined.dimension()),
      .point_count = static_cast<int64_t>(joined.point_count()),
      .vertex_count = joined.vertex_count(),
      .revision = joined.session().revision(),
      .pose = {},
      .participant_id = joined.participant_id()};
  DEFORM_ASSIGN_OR_RETURN(result.pose.vertices,
                          ReadRows(joined.pose(), result.dimension));
  if (result.pose.vertices.rows() != result.vertex_count) {
    return BadAnswer("pose");
  }
  result.pose.stretch_blend = joined.stretch_blend();
  return result;
}

absl::StatusOr<RigChange> FromProto(const v1::RigChanged& changed,
                                    int dimension) {
  RigChange change{.binding_id = changed.binding_id(),
                   .revision = changed.revision(),
                   .vertex_count = changed.vertex_count(),
                   .previous = {changed.previous_vertices().begin(),
                                changed.previous_vertices().end()},
                   .largest_jump = changed.largest_jump()};
  DEFORM_ASSIGN_OR_RETURN(change.pose.vertices,
                          ReadRows(changed.pose(), dimension));
  change.pose.stretch_blend = changed.stretch_blend();
  if (change.pose.vertices.rows() != change.vertex_count ||
      std::ssize(change.previous) != change.vertex_count) {
    return BadAnswer("rig_changed");
  }
  return change;
}

v1::CreateBindingRequest ToProto(const BindingSpec& spec,
                                 const std::string& tenant) {
  v1::CreateBindingRequest request;
  request.set_tenant(tenant);
  request.set_model_id(spec.model_id);
  request.set_scheme(spec.scheme);
  *request.mutable_rig() = ToProto(spec.rig);
  request.mutable_options()->mutable_handle_weights()->Add(
      spec.options.handle_weights.begin(), spec.options.handle_weights.end());
  request.mutable_options()->set_lambda(spec.options.lambda);
  SetExits(spec.exits, request);
  request.set_unbindable(spec.unbindable == Unbindable::kReport
                             ? v1::UNBINDABLE_REPORT
                             : v1::UNBINDABLE_FAIL);
  request.set_flip_inside_out(spec.flip_inside_out);
  request.set_add_box_handles(spec.add_box_handles);
  request.mutable_clamped_points()->Add(spec.clamped.begin(),
                                        spec.clamped.end());
  if (spec.weight_tolerance) {
    request.set_weight_tolerance(*spec.weight_tolerance);
  }
  return request;
}

v1::HandleEdit ToProto(const HandleEdit& edit, int dimension) {
  v1::HandleEdit proto;
  const auto handle = static_cast<uint32_t>(edit.handle);
  const Positions place = edit.position.transpose();
  switch (edit.kind) {
    case HandleEdit::Kind::kAdd:
      AppendRows(place, Columns(dimension),
                 proto.mutable_add()->mutable_position());
      proto.mutable_add()->set_weight(edit.weight);
      break;
    case HandleEdit::Kind::kMove:
      proto.mutable_move()->set_handle(handle);
      AppendRows(place, Columns(dimension),
                 proto.mutable_move()->mutable_position());
      break;
    case HandleEdit::Kind::kRemove:
      proto.mutable_remove()->set_handle(handle);
      break;
  }
  return proto;
}

v1::Pose ToProto(const PoseUpdate& update, int dimension, uint64_t sequence,
                 uint64_t rig_changes) {
  v1::Pose pose;
  pose.set_sequence(sequence);
  pose.set_rig_changes(rig_changes);
  for (const int32_t vertex : update.vertices) {
    pose.add_vertices(static_cast<uint32_t>(vertex));
  }
  AppendRows(update.positions, Columns(dimension), pose.mutable_positions());
  if (update.stretch_blend) pose.set_stretch_blend(*update.stretch_blend);
  return pose;
}

ModelBytes::ModelBytes(const ModelArrays& model) {
  const int columns = Columns(model.dimension);
  positions_.reserve(model.positions.rows() * columns);
  for (int64_t i = 0; i < model.positions.rows(); ++i) {
    for (int k = 0; k < columns; ++k) {
      positions_.push_back(model.positions(i, k));
    }
  }
  corners_.reserve(model.faces.size());
  for (const int32_t corner : model.faces.reshaped<Eigen::RowMajor>()) {
    corners_.push_back(static_cast<uint32_t>(corner));
  }
}

int64_t ModelBytes::size() const {
  return static_cast<int64_t>(positions_.size() * sizeof(double) +
                              corners_.size() * sizeof(uint32_t));
}

std::string ModelBytes::Range(int64_t offset, int64_t count) const {
  const auto split = static_cast<int64_t>(positions_.size() * sizeof(double));
  std::string bytes;
  bytes.reserve(count);
  if (offset < split) {
    bytes.append(reinterpret_cast<const char*>(positions_.data()) + offset,
                 std::min(count, split - offset));
  }
  if (offset + count > split) {
    const int64_t from = std::max(offset - split, int64_t{0});
    bytes.append(reinterpret_cast<const char*>(corners_.data()) + from,
                 offset + count - split - from);
  }
  return bytes;
}

}  // namespace deform
