// What GetQuality is asked, and its answers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/quality/pose_quality.h"
#include "deform/v1/quality.pb.h"
#include "server/models/binding_registry.h"
#include "server/sessions/session_manager.h"

namespace deform::server {

// What a report is made from, once it is found to be right.
struct QualityTask {
  BindingFacts facts;
  std::optional<PoseQualityRequest> posed;
  // To be set if there is a pose: volumes are those of its frame.
  std::shared_ptr<const Binding> binding = nullptr;
};

// InvalidArgument TOO_MANY_POINTS, OTHER_BINDING (of the session), and what
// CheckPoseUpdate() refuses; NotFound SESSION_NOT_FOUND.
absl::StatusOr<QualityTask> ToQualityTask(const v1::GetQualityRequest& request,
                                          const std::string& tenant,
                                          const BindingRecord& record,
                                          SessionManager& sessions);

struct Quality {
  BindQuality binding;
  double rig_distance_min = 0;  // In units of D.
  std::optional<PoseQuality> pose;
};

// Tells the points of the pose that are done. Cancelled.
absl::StatusOr<Quality> MeasureQuality(const QualityTask& task,
                                       const BindControl& control);

v1::QualityReport ToProto(const Quality& quality);

// Points for one message.
inline constexpr int64_t kQualityPointsPerMessage = 32768;
// Those from the `first` on, as many as a message holds.
v1::QualityPoints ToProto(const PoseQuality& quality, int64_t first);

}  // namespace deform::server
