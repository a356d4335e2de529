// The conversions of Deform streams.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/frames/encoding.h"
#include "server/rpc/convert.h"
#include "server/rpc/convert_parts.h"

namespace deform::server {
namespace {

constexpr int kMaxEncodings = 16;

absl::Status ReadWishes(const v1::Join& join, FrameWishes& wishes) {
  const int offered = std::min(join.encodings_size(), kMaxEncodings);
  for (int i = 0; i < offered; ++i) {
    const FrameEncoding* const encoding = FindEncoding(join.encodings(i));
    if (encoding != nullptr) wishes.encodings.push_back(encoding);
  }
  if (offered > 0 && wishes.encodings.empty()) {
    std::vector<absl::string_view> known;
    for (const FrameEncoding* e : AllEncodings()) known.push_back(e->id());
    return InvalidInput("UNKNOWN_ENCODING", "encodings",
                        absl::StrCat("none of the encodings is known; known: ",
                                     absl::StrJoin(known, ", ")));
  }
  wishes.cheapest = join.cheapest_encoding();
  wishes.max_fps = join.max_fps();
  wishes.normals = join.normals();
  DEFORM_ASSIGN_OR_RETURN(wishes.weights, FromProto(join.held()));
  if (join.has_tolerance()) wishes.tolerance = join.tolerance();
  if (join.has_tolerance_fraction()) {
    wishes.tolerance_fraction = join.tolerance_fraction();
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<WeightsId> FromProto(const v1::HeldWeights& held) {
  if (!held.binding_id().empty()) {
    DEFORM_RETURN_IF_ERROR(CheckName(held.binding_id(), "held.binding_id"));
  }
  if (!held.basis_id().empty()) {
    DEFORM_RETURN_IF_ERROR(CheckName(held.basis_id(), "held.basis_id"));
  }
  return WeightsId{.binding = held.binding_id(), .basis = held.basis_id()};
}

absl::StatusOr<JoinRequest> FromProto(const v1::Join& join) {
  JoinRequest request;
  DEFORM_ASSIGN_OR_RETURN(request.tenant, TenantOr(join.tenant()));
  DEFORM_RETURN_IF_ERROR(CheckName(join.session_id(), "session_id"));
  request.session_id = join.session_id();
  if (!v1::Delivery_IsValid(join.delivery())) {
    return UnknownValue("delivery", join.delivery());
  }
  if (join.delivery() == v1::DELIVERY_EVERY)
    request.delivery = Delivery::kEvery;
  DEFORM_RETURN_IF_ERROR(ReadWishes(join, request.frames));
  return request;
}

void ToProto(const Session::Joined& joined, v1::Joined* out) {
  const BindingFacts& binding = joined.binding;
  ToProto(joined.state, out->mutable_session());
  out->set_encoding(std::string(joined.format.encoding->id()));
  out->set_tolerance(joined.format.tolerance);
  out->set_dimension(binding.dimension());
  out->set_point_count(binding.point_count());
  const int64_t rows = PoseRows(binding.rig());
  out->set_vertex_count(rows);
  AddRows(joined.pose.vertices.topRows(rows), binding.dimension(),
          out->mutable_pose());
  out->set_stretch_blend(joined.pose.stretch_blend);
  out->set_participant_id(joined.participant_id);
  out->set_resume_token(joined.token);
  out->set_resumed(joined.resumed);
  out->set_last_sequence(joined.last_sequence);
}

void ToProto(const RigChange& change, v1::RigChanged* out) {
  const std::vector<int32_t>& previous = change.transfer.previous();
  const Pose& pose = change.transfer.pose();
  out->set_binding_id(change.binding_id);
  out->set_revision(change.revision);
  out->set_vertex_count(previous.size());
  out->mutable_previous_vertices()->Add(previous.begin(), previous.end());
  AddRows(pose.vertices.topRows(std::ssize(previous)), change.dimension,
          out->mutable_pose());
  out->set_stretch_blend(pose.stretch_blend);
  out->set_largest_jump(change.largest_jump);
}

}  // namespace deform::server
