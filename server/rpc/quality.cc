#include "server/rpc/quality.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/quality/rig_distance.h"
#include "server/rpc/convert.h"

namespace deform::server {
namespace {

constexpr uint32_t kMostPoints = 1'000'000;

absl::StatusOr<Pose> PoseOfSession(const std::string& id,
                                   const std::string& tenant,
                                   const BindingRecord& record,
                                   SessionManager& sessions) {
  DEFORM_RETURN_IF_ERROR(CheckName(id, "session_id"));
  DEFORM_ASSIGN_OR_RETURN(const auto session,
                          sessions.catalogue().Find(tenant, id));
  Session::Posed posed = session->posed();
  if (posed.binding_id != record.id) {
    return InvalidInput("OTHER_BINDING", "session_id",
                        absl::StrCat("session ", id, " poses binding ",
                                     posed.binding_id, ", not ", record.id));
  }
  return std::move(posed.pose);
}

v1::VolumeKind ToProto(VolumeKind kind) {
  switch (kind) {
    case VolumeKind::kClosed:
      return v1::VOLUME_KIND_CLOSED;
    case VolumeKind::kCapped:
      return v1::VOLUME_KIND_CAPPED;
    case VolumeKind::kArea:
      return v1::VOLUME_KIND_AREA;
    case VolumeKind::kNone:
      break;
  }
  return v1::VOLUME_KIND_UNSPECIFIED;
}

void SetPose(const PoseQuality& quality, v1::PoseQuality* out) {
  out->set_point_count(quality.points.size());
  out->set_sampled(quality.sampled);
  out->set_near_rig_count(quality.near_rig);
  out->set_fixed_count(quality.fixed);
  out->set_distortion_max(quality.distortion_max);
  out->set_distortion_p99(quality.distortion_p99);
  out->set_distortion_median(quality.distortion_median);
  if (quality.most_distorted >= 0) {
    out->set_most_distorted_point(quality.most_distorted);
  }
  const Histogram& histogram = quality.distortion;
  out->mutable_distortion_edges()->Add(histogram.edges.begin(),
                                       histogram.edges.end());
  out->mutable_distortion_counts()->Add(histogram.counts.begin(),
                                        histogram.counts.end());
  out->set_fold_over_count(quality.fold_overs);
  out->set_volume_change_min(quality.volume_change_min);
  out->set_volume_change_median(quality.volume_change_median);
  out->set_volume_change_max(quality.volume_change_max);
  out->set_volume_kind(ToProto(quality.volume_kind));
  out->set_volume_rest(quality.volume_rest);
  out->set_volume_posed(quality.volume_posed);
}

}  // namespace

absl::StatusOr<QualityTask> ToQualityTask(const v1::GetQualityRequest& request,
                                          const std::string& tenant,
                                          const BindingRecord& record,
                                          SessionManager& sessions) {
  QualityTask task{.facts = record.facts, .posed = std::nullopt};
  if (request.max_points() > kMostPoints) {
    return InvalidInput("TOO_MANY_POINTS", "max_points",
                        absl::StrCat("max_points is at most ", kMostPoints,
                                     ", not ", request.max_points()));
  }
  PoseQualityRequest posed;
  if (request.max_points() > 0) posed.max_points = request.max_points();
  switch (request.posed_case()) {
    case v1::GetQualityRequest::kPose: {
      const Rig& rig = record.facts.rig();
      DEFORM_ASSIGN_OR_RETURN(
          const PoseUpdate update,
          FromProto(request.pose(), record.facts.dimension()));
      DEFORM_RETURN_IF_ERROR(CheckPoseUpdate(update, rig));
      posed.pose = RestPose(rig);
      ApplyPoseUpdate(update, posed.pose);
      break;
    }
    case v1::GetQualityRequest::kSessionId: {
      DEFORM_ASSIGN_OR_RETURN(
          posed.pose,
          PoseOfSession(request.session_id(), tenant, record, sessions));
      break;
    }
    case v1::GetQualityRequest::POSED_NOT_SET:
      return task;
  }
  task.posed = std::move(posed);
  return task;
}

absl::StatusOr<Quality> MeasureQuality(const QualityTask& task,
                                       const BindControl& control) {
  Quality quality{.binding = task.facts.quality()};
  DEFORM_ASSIGN_OR_RETURN(
      const double distance,
      SmallestDistance(task.facts, control.pool, control.cancellation));
  quality.rig_distance_min = distance / DiagonalOf(task.facts.rig());
  if (task.posed) {
    DEFORM_ASSIGN_OR_RETURN(quality.pose,
                            MeasurePose(task.binding, *task.posed, control));
  }
  return quality;
}

v1::QualityReport ToProto(const Quality& quality) {
  v1::QualityReport report;
  ToProto(quality.binding, report.mutable_binding());
  report.set_rig_distance_min(quality.rig_distance_min);
  if (quality.pose) SetPose(*quality.pose, report.mutable_pose());
  return report;
}

v1::QualityPoints ToProto(const PoseQuality& quality, int64_t first) {
  v1::QualityPoints message;
  const int64_t end = std::min<int64_t>(first + kQualityPointsPerMessage,
                                        std::ssize(quality.points));
  for (int64_t i = first; i < end; ++i) {
    const PointQuality& point = quality.points[i];
    message.add_points(point.point);
    message.add_distortion(static_cast<float>(point.distortion));
    message.add_volume_change(static_cast<float>(std::clamp(
        point.volume_change, double{std::numeric_limits<float>::lowest()},
        double{std::numeric_limits<float>::max()})));
  }
  return message;
}

}  // namespace deform::server
