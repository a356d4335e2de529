// The conversions of what participants see of each other.
#include "client/cpp/convert.h"
#include "core/base/error.h"

namespace deform {

ParticipantInfo FromProto(const v1::Participant& participant) {
  ParticipantInfo info{
      .id = participant.participant_id(),
      .name = participant.name(),
      .role = participant.role() == v1::ROLE_VIEWER ? ParticipantRole::kViewer
                                                    : ParticipantRole::kEditor,
      .grabbed = {participant.grabbed().begin(), participant.grabbed().end()},
      .cursor = participant.cursor()};
  for (const v1::HandleLock& lock : participant.locks()) {
    info.locked.push_back(static_cast<int32_t>(lock.vertex()));
  }
  return info;
}

AcknowledgedRequest FromProto(const v1::Acknowledged& done) {
  return {.sequence = done.sequence(),
          .edit = done.edit(),
          .left_out = {done.left_out().begin(), done.left_out().end()}};
}

absl::StatusOr<CurrentPose> FromProto(const v1::CurrentPose& current,
                                      int dimension) {
  if (current.pose_size() % dimension != 0) {
    return InvalidInput("BAD_ANSWER", "current.pose",
                        "the server told a pose that cannot be");
  }
  CurrentPose result{.revision = current.revision()};
  Positions& vertices = result.pose.vertices;
  vertices = Positions::Zero(current.pose_size() / dimension, 3);
  for (int i = 0; i < current.pose_size(); ++i) {
    vertices(i / dimension, i % dimension) = current.pose(i);
  }
  result.pose.stretch_blend = current.stretch_blend();
  return result;
}

}  // namespace deform
