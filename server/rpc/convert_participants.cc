// The conversions of what participants say and show to each other.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/rpc/convert.h"
#include "server/rpc/convert_parts.h"
#include "server/rpc/status.h"

namespace deform::server {
namespace {

constexpr size_t kMaxTokenBytes = 64;

v1::Role ToProto(Role role) {
  return role == Role::kViewer ? v1::ROLE_VIEWER : v1::ROLE_EDITOR;
}

void ToProto(const Attendee& attendee,
             std::chrono::steady_clock::time_point now, v1::Participant* out) {
  out->set_participant_id(attendee.id);
  out->set_name(attendee.name);
  out->set_role(ToProto(attendee.role));
  out->mutable_grabbed()->Add(attendee.shown.grabbed.begin(),
                              attendee.shown.grabbed.end());
  out->set_cursor(attendee.shown.cursor);
  for (const HandleLocks::Held& held : attendee.locks) {
    if (held.until <= now) continue;
    v1::HandleLock* lock = out->add_locks();
    lock->set_vertex(held.handle);
    lock->set_remaining_ms(static_cast<uint32_t>(
        std::chrono::ceil<std::chrono::milliseconds>(held.until - now)
            .count()));
  }
}

}  // namespace

absl::StatusOr<std::vector<int32_t>> ToHandles(
    const google::protobuf::RepeatedField<uint32_t>& vertices,
    absl::string_view field) {
  for (const uint32_t vertex : vertices) {
    if (vertex <= INT32_MAX) continue;
    return InvalidInput("INDEX_OUT_OF_RANGE", field,
                        absl::StrCat(field, " names vertex ", vertex));
  }
  return std::vector<int32_t>(vertices.begin(), vertices.end());
}

absl::StatusOr<Introduction> IntroductionOf(const v1::Join& join) {
  if (!v1::Role_IsValid(join.role())) {
    return UnknownValue("role", join.role());
  }
  if (join.resume().token().size() > kMaxTokenBytes) {
    return InvalidInput(
        "BAD_TOKEN", "resume.token",
        absl::StrCat("a resume token of ", join.resume().token().size(),
                     " bytes; at most ", kMaxTokenBytes));
  }
  Introduction who{
      .role = join.role() == v1::ROLE_VIEWER ? Role::kViewer : Role::kEditor,
      .name = join.name(),
      .wants_presence = join.presence(),
      .token = join.resume().token(),
      .last_sequence = join.resume().last_sequence(),
      .rig_changes = join.resume().rig_changes(),
      .attempt = join.resume().attempt()};
  if (join.resume().has_last_revision()) {
    who.last_revision = join.resume().last_revision();
  }
  return who;
}

absl::StatusOr<Shown> FromProto(const v1::Presence& presence) {
  DEFORM_ASSIGN_OR_RETURN(std::vector<int32_t> grabbed,
                          ToHandles(presence.grabbed(), "presence.grabbed"));
  return Shown{.grabbed = std::move(grabbed), .cursor = presence.cursor()};
}

PoseTerms TermsOf(const v1::Pose& pose) {
  PoseTerms terms{.rig_changes = pose.rig_changes(), .edit = pose.edit()};
  if (pose.has_base_revision()) terms.base_revision = pose.base_revision();
  return terms;
}

void ToProto(const Rejection& rejection, v1::PoseRejected* out) {
  out->set_sequence(rejection.sequence);
  *out->mutable_status() = ToRpcStatus(rejection.status);
  if (!rejection.current) return;
  v1::CurrentPose* current = out->mutable_current();
  current->set_revision(rejection.current->revision);
  const Pose& pose = rejection.current->pose;
  AddRows(pose.vertices, rejection.current->dimension, current->mutable_pose());
  current->set_stretch_blend(pose.stretch_blend);
}

void ToProto(const Acknowledgement& acknowledgement, v1::Acknowledged* out) {
  out->set_sequence(acknowledgement.sequence);
  out->set_edit(acknowledgement.edit);
  out->mutable_left_out()->Add(acknowledgement.left_out.begin(),
                               acknowledgement.left_out.end());
}

void ToProto(const PresenceChange& change,
             std::chrono::steady_clock::time_point now, v1::Participants* out) {
  out->set_complete(change.complete);
  for (const Attendee& attendee : change.present) {
    ToProto(attendee, now, out->add_participants());
  }
  for (const int64_t id : change.left) out->add_left(id);
}

}  // namespace deform::server
