#include "server/rpc/convert.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/compress_binding.h"
#include "server/rpc/convert_parts.h"

namespace deform::server {
namespace {

using Doubles = google::protobuf::RepeatedField<double>;
using Indices = google::protobuf::RepeatedField<uint32_t>;

absl::Status CheckDimension(uint32_t dimension, absl::string_view field) {
  if (dimension == 2 || dimension == 3) return absl::OkStatus();
  return InvalidInput(
      "BAD_DIMENSION", field,
      absl::StrCat("dimension must be 2 or 3, not ", dimension));
}

absl::Status CheckLength(int64_t length, int dimension,
                         absl::string_view field) {
  if (length % dimension == 0) return absl::OkStatus();
  return InvalidInput(
      "WRONG_LENGTH", field,
      absl::StrCat(field, " has ", length, " numbers, which is no multiple of ",
                   dimension));
}

// Rows of `dimension` numbers; the third column is 0 in 2D.
absl::StatusOr<Positions> ToPositions(const Doubles& numbers, int dimension,
                                      absl::string_view field) {
  DEFORM_RETURN_IF_ERROR(CheckLength(numbers.size(), dimension, field));
  Positions positions = Positions::Zero(numbers.size() / dimension, 3);
  positions.leftCols(dimension) =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic,
                                     Eigen::RowMajor>>(
          numbers.data(), positions.rows(), dimension);
  return positions;
}

absl::StatusOr<int32_t> ToIndex(uint32_t index, absl::string_view field,
                                int64_t entry) {
  if (index <= static_cast<uint32_t>(std::numeric_limits<int32_t>::max())) {
    return static_cast<int32_t>(index);
  }
  return InvalidInput("INDEX_OUT_OF_RANGE", field,
                      absl::StrCat(field, " entry ", entry, " is ", index,
                                   ", beyond every vertex and face"));
}

absl::StatusOr<Faces> ToFaces(const Indices& corners, int dimension,
                              absl::string_view field) {
  DEFORM_RETURN_IF_ERROR(CheckLength(corners.size(), dimension, field));
  Faces faces(corners.size() / dimension, dimension);
  for (int64_t i = 0; i < corners.size(); ++i) {
    DEFORM_ASSIGN_OR_RETURN(faces.data()[i], ToIndex(corners[i], field, i));
  }
  return faces;
}

absl::StatusOr<std::vector<int32_t>> ToIndices(const Indices& indices,
                                               absl::string_view field) {
  std::vector<int32_t> result(indices.size());
  for (int i = 0; i < indices.size(); ++i) {
    DEFORM_ASSIGN_OR_RETURN(result[i], ToIndex(indices[i], field, i));
  }
  return result;
}

absl::StatusOr<Rig> ToRig(const v1::Cage& cage, bool flip) {
  DEFORM_RETURN_IF_ERROR(
      CheckDimension(cage.dimension(), "rig.cage.dimension"));
  const int dimension = static_cast<int>(cage.dimension());
  DEFORM_ASSIGN_OR_RETURN(
      Positions vertices,
      ToPositions(cage.vertices(), dimension, "rig.cage.vertices"));
  DEFORM_ASSIGN_OR_RETURN(
      Faces faces, ToFaces(cage.corners(), dimension, "rig.cage.corners"));
  DEFORM_ASSIGN_OR_RETURN(
      Cage made, Cage::Create(dimension, std::move(vertices), std::move(faces),
                              flip ? Cage::Orientation::kFlipIfInsideOut
                                   : Cage::Orientation::kAsGiven));
  return Rig(std::move(made));
}

// `model`: whose box is to be added, or null.
absl::StatusOr<Rig> ToRig(const v1::Handles& handles, const Mesh* model) {
  DEFORM_RETURN_IF_ERROR(
      CheckDimension(handles.dimension(), "rig.handles.dimension"));
  const int dimension = static_cast<int>(handles.dimension());
  DEFORM_ASSIGN_OR_RETURN(
      Positions positions,
      ToPositions(handles.positions(), dimension, "rig.handles.positions"));
  DEFORM_ASSIGN_OR_RETURN(Positions fixed,
                          ToPositions(handles.fixed_positions(), dimension,
                                      "rig.handles.fixed_positions"));
  if (model != nullptr) {
    DEFORM_RETURN_IF_ERROR(CheckSameDimension(*model, dimension));
    const Positions box = BoxHandles(*model);
    fixed.conservativeResize(fixed.rows() + box.rows(), 3);
    fixed.bottomRows(box.rows()) = box;
  }
  DEFORM_ASSIGN_OR_RETURN(
      Handles made, Handles::Create(dimension, std::move(positions), fixed));
  return Rig(std::move(made));
}

absl::StatusOr<Rig> ToRig(const v1::CreateBindingRequest& request,
                          const Mesh* model) {
  const v1::Rig& rig = request.rig();
  switch (rig.kind_case()) {
    case v1::Rig::kCage:
      if (request.add_box_handles()) {
        return InvalidInput("WRONG_RIG", "add_box_handles",
                            "the corners of a box can be added to handles; a "
                            "cage has none");
      }
      return ToRig(rig.cage(), request.flip_inside_out());
    case v1::Rig::kHandles:
      return ToRig(rig.handles(), request.add_box_handles() ? model : nullptr);
    case v1::Rig::KIND_NOT_SET:
      break;
  }
  return InvalidInput("MISSING_FIELD", "rig", "rig is a cage or handles");
}

absl::StatusOr<ExitRegions> ToExitRegions(const v1::ExitRegions& exits) {
  ExitRegions regions;
  switch (exits.choice_case()) {
    case v1::ExitRegions::kAutomatic:
      regions.kind = ExitRegions::Kind::kAutomatic;
      break;
    case v1::ExitRegions::kFaces: {
      regions.kind = ExitRegions::Kind::kFaces;
      DEFORM_ASSIGN_OR_RETURN(
          regions.faces, ToIndices(exits.faces().faces(), "exits.faces.faces"));
      break;
    }
    case v1::ExitRegions::kPerPoint:
      regions.kind = ExitRegions::Kind::kPerPoint;
      regions.face_of_point.assign(exits.per_point().faces().begin(),
                                   exits.per_point().faces().end());
      break;
    case v1::ExitRegions::CHOICE_NOT_SET:
      break;
  }
  return regions;
}

// Sorted, each once.
absl::StatusOr<std::vector<int64_t>> ToClamped(
    const google::protobuf::RepeatedField<uint64_t>& points) {
  constexpr uint64_t kMostPoints = uint64_t{1} << 62;
  std::vector<int64_t> clamped;
  clamped.reserve(points.size());
  for (int i = 0; i < points.size(); ++i) {
    if (points[i] > kMostPoints) {
      return InvalidInput("INDEX_OUT_OF_RANGE", "clamped_points",
                          absl::StrCat("clamped_points entry ", i, " is ",
                                       points[i], ", beyond every point"));
    }
    clamped.push_back(static_cast<int64_t>(points[i]));
  }
  std::sort(clamped.begin(), clamped.end());
  clamped.erase(std::unique(clamped.begin(), clamped.end()), clamped.end());
  return clamped;
}

void ToProto(absl::Time time, google::protobuf::Timestamp* out) {
  const int64_t nanos = absl::ToUnixNanos(time);
  out->set_seconds(nanos / 1'000'000'000);
  out->set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
}

}  // namespace

absl::StatusOr<PageRequest> ToPageRequest(uint32_t page_size,
                                          const std::string& page_token) {
  if (page_size > kMaxPageSize) {
    return InvalidInput("PAGE_TOO_LARGE", "page_size",
                        absl::StrCat("page_size is at most ", kMaxPageSize,
                                     ", not ", page_size));
  }
  if (!page_token.empty() && !CheckName(page_token, "page_token").ok()) {
    return InvalidInput("BAD_PAGE_TOKEN", "page_token",
                        "page_token is not one of a page before");
  }
  PageRequest page{.after = page_token};
  if (page_size > 0) page.size = static_cast<int>(page_size);
  return page;
}

absl::StatusOr<ModelUpload::Header> FromProto(const v1::ModelHeader& header) {
  if (header.display_name().size() > kMaxDisplayNameBytes) {
    return InvalidInput(
        "NAME_TOO_LONG", "header.display_name",
        absl::StrCat("display_name has ", header.display_name().size(),
                     " bytes; at most ", kMaxDisplayNameBytes));
  }
  return ModelUpload::Header{.dimension = header.dimension(),
                             .vertex_count = header.vertex_count(),
                             .face_count = header.face_count()};
}

absl::StatusOr<BindSpec> FromProto(const v1::CreateBindingRequest& request,
                                   const Mesh* model, double weight_tolerance) {
  if (request.has_weight_tolerance()) {
    weight_tolerance = request.weight_tolerance();
  }
  DEFORM_RETURN_IF_ERROR(CheckWeightTolerance(weight_tolerance));
  DEFORM_ASSIGN_OR_RETURN(std::string tenant, TenantOr(request.tenant()));
  DEFORM_RETURN_IF_ERROR(CheckName(request.model_id(), "model_id"));
  if (request.scheme().empty()) {
    return InvalidInput("MISSING_FIELD", "scheme",
                        "scheme is an id of ListSchemes, such as green");
  }
  DEFORM_RETURN_IF_ERROR(CheckName(request.scheme(), "scheme"));
  if (!v1::Unbindable_IsValid(request.unbindable())) {
    return UnknownValue("unbindable", request.unbindable());
  }
  DEFORM_ASSIGN_OR_RETURN(Rig rig, ToRig(request, model));
  DEFORM_ASSIGN_OR_RETURN(ExitRegions exits, ToExitRegions(request.exits()));
  DEFORM_ASSIGN_OR_RETURN(std::vector<int64_t> clamped,
                          ToClamped(request.clamped_points()));
  const auto& weights = request.options().handle_weights();
  return BindSpec{
      .tenant = std::move(tenant),
      .model_id = request.model_id(),
      .rig = std::move(rig),
      .scheme = request.scheme(),
      .options = {.handle_weights = {weights.begin(), weights.end()},
                  .lambda = request.options().lambda()},
      .exits = std::move(exits),
      .unbindable = request.unbindable() == v1::UNBINDABLE_REPORT
                        ? Unbindable::kReport
                        : Unbindable::kFail,
      .clamped = std::move(clamped),
      .weight_tolerance = weight_tolerance};
}

absl::StatusOr<PoseUpdate> FromProto(const v1::Pose& pose, int dimension) {
  PoseUpdate update;
  DEFORM_ASSIGN_OR_RETURN(update.vertices,
                          ToIndices(pose.vertices(), "pose.vertices"));
  DEFORM_ASSIGN_OR_RETURN(
      update.positions,
      ToPositions(pose.positions(), dimension, "pose.positions"));
  if (pose.has_stretch_blend()) update.stretch_blend = pose.stretch_blend();
  return update;
}

void ToProto(const ModelRecord& record, v1::Model* model) {
  const Mesh& mesh = *record.mesh;
  model->set_tenant(record.tenant);
  model->set_model_id(record.id);
  model->set_display_name(record.display_name);
  model->set_dimension(mesh.dimension());
  model->set_vertex_count(mesh.size());
  model->set_face_count(mesh.faces().rows());
  for (int c = 0; c < mesh.dimension(); ++c) {
    model->add_box_min(mesh.box().min[c]);
    model->add_box_max(mesh.box().max[c]);
  }
  ToProto(record.create_time, model->mutable_create_time());
}

void ToProto(const BindingRecord& record, Detail detail, v1::Binding* out) {
  const BindingFacts& binding = record.facts;
  out->set_tenant(record.tenant);
  out->set_binding_id(record.id);
  out->set_model_id(record.model_id);
  out->set_scheme(std::string(binding.scheme().id()));
  out->set_dimension(binding.dimension());
  out->set_point_count(binding.point_count());
  out->set_vertex_count(PoseRows(binding.rig()));
  out->set_fixed_handle_count(binding.vertex_count() - PoseRows(binding.rig()));
  out->set_normal_count(binding.normal_count());
  out->set_rig_diagonal(DiagonalOf(binding.rig()));
  const WeightsCache::Slot::State weights = record.weights->state();
  out->set_weight_bytes(weights.bytes);
  out->set_weight_state(weights.resident ? v1::WEIGHT_STATE_RESIDENT
                                         : v1::WEIGHT_STATE_EVICTED);
  out->set_weight_form(weights.compressed ? v1::WEIGHT_FORM_COMPRESSED
                                          : v1::WEIGHT_FORM_DENSE);
  out->set_weight_tolerance(record.weight_tolerance);
  out->set_weight_error_bound(weights.bound);
  const int64_t dense_bytes = DenseWeightBytes(binding);
  out->set_dense_weight_bytes(dense_bytes);
  if (weights.bytes > 0) {
    out->set_compression_ratio(static_cast<double>(dense_bytes) /
                               static_cast<double>(weights.bytes));
  }
  out->set_why_dense(weights.why_dense);
  out->set_weight_users(weights.users);
  ToProto(weights.last_use, out->mutable_last_use_time());
  out->set_compute_seconds(binding.compute_seconds());
  ToProto(binding.quality(), out->mutable_quality());
  out->set_unbound_count(binding.unbound_count());
  out->set_clamped_count(binding.clamped().size());
  ToProto(record.create_time, out->mutable_create_time());
  if (detail == Detail::kSummary) return;
  for (const UnboundPoints& unbound : binding.unbound()) {
    auto* to = out->add_unbound();
    to->set_reason(unbound.reason);
    to->mutable_points()->Add(unbound.points.begin(), unbound.points.end());
  }
  for (const ExitPart& part : binding.exit_parts()) {
    auto* to = out->add_exit_parts();
    to->set_exit_face(part.exit_face);
    to->set_point_count(part.points.size());
    if (!part.points.empty()) to->set_first_point(part.points.front());
    to->mutable_crossed_faces()->Add(part.crossed_faces.begin(),
                                     part.crossed_faces.end());
  }
  for (const std::string& warning : binding.warnings()) {
    out->add_warnings(warning);
  }
  out->mutable_clamped_points()->Add(binding.clamped().begin(),
                                     binding.clamped().end());
}

void ToProto(const BindProgress& progress, v1::BindingProgress* out) {
  out->set_points_done(progress.points_done);
  out->set_points_total(progress.points_total);
}

void ToProto(const BindQuality& quality, v1::BindingQuality* out) {
  out->set_reproduction_error(quality.reproduction_error);
  out->set_partition_error(quality.partition_error);
  out->set_weight_min(quality.weight_min);
  out->set_weight_max(quality.weight_max);
  out->set_weight_sum_max(quality.weight_sum_max);
  out->set_iterations_total(quality.iterations_total);
  out->set_iterations_max(quality.iterations_max);
  out->set_iterations_mean(quality.iterations_mean);
  out->set_residual_max(quality.residual_max);
  out->set_residual_mean(quality.residual_mean);
}

void ToProto(const Rig& rig, v1::Rig* out) {
  const int dimension = DimensionOf(rig);
  if (const Cage* cage = std::get_if<Cage>(&rig)) {
    out->mutable_cage()->set_dimension(dimension);
    AddRows(cage->vertices(), dimension,
            out->mutable_cage()->mutable_vertices());
    const Faces& faces = cage->faces();
    out->mutable_cage()->mutable_corners()->Add(faces.data(),
                                                faces.data() + faces.size());
    return;
  }
  const auto& handles = std::get<Handles>(rig);
  out->mutable_handles()->set_dimension(dimension);
  AddRows(handles.positions().topRows(handles.free_count()), dimension,
          out->mutable_handles()->mutable_positions());
  AddRows(handles.positions().bottomRows(handles.fixed_count()), dimension,
          out->mutable_handles()->mutable_fixed_positions());
}

void ToProto(const SessionState& state, v1::Session* session) {
  session->set_tenant(state.tenant);
  session->set_session_id(state.id);
  session->set_binding_id(state.binding_id);
  session->set_revision(state.revision);
  session->set_durable_revision(state.durable_revision);
  session->set_epoch(state.epoch);
  session->set_participant_count(state.participants);
  ToProto(state.create_time, session->mutable_create_time());
}

void ToProto(const CoordinateScheme& scheme, v1::Scheme* out) {
  out->set_scheme(std::string(scheme.id()));
  out->set_description(std::string(scheme.description()));
  out->set_takes_cage(scheme.rig_kind() == RigKind::kCage);
  out->set_uses_normals(scheme.uses_normals());
}

}  // namespace deform::server
