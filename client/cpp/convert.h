// Between the values of this library and the messages of deform/v1.
#pragma once

#include "client/cpp/arrays.h"
#include "client/cpp/client.h"
#include "client/cpp/info.h"
#include "core/deform/pose.h"
#include "deform/v1/binding.pb.h"
#include "deform/v1/model.pb.h"
#include "deform/v1/quality.pb.h"
#include "deform/v1/server.pb.h"
#include "deform/v1/session.pb.h"

namespace deform {

ModelInfo FromProto(const v1::Model& model);
BindQuality FromProto(const v1::BindingQuality& quality);
BindingInfo FromProto(const v1::Binding& binding);
QualityInfo FromProto(const v1::QualityReport& report);
EditedBinding FromProto(const v1::HandlesEdited& edited);
SessionInfo FromProto(const v1::Session& session);
SchemeInfo FromProto(const v1::Scheme& scheme);
ServerStatus FromProto(const v1::ServerStatus& status);

// InvalidArgument (BAD_ANSWER) if the numbers do not fit together.
absl::StatusOr<RigArrays> FromProto(const v1::Rig& rig);
absl::StatusOr<WeightRows> FromProto(const v1::GetWeightsResponse& weights);
absl::StatusOr<JoinedSession> FromProto(const v1::Joined& joined);
absl::StatusOr<RigChange> FromProto(const v1::RigChanged& changed,
                                    int dimension);

ParticipantInfo FromProto(const v1::Participant& participant);
AcknowledgedRequest FromProto(const v1::Acknowledged& done);
absl::StatusOr<CurrentPose> FromProto(const v1::CurrentPose& current,
                                      int dimension);

// Adds to the points of the pose. InvalidArgument (BAD_ANSWER) if the numbers
// do not fit together.
absl::Status AddPoints(const v1::QualityPoints& points, QualityInfo& info);

// `tenant` and `model_id` included.
v1::CreateBindingRequest ToProto(const BindingSpec& spec,
                                 const std::string& tenant);
v1::HandleEdit ToProto(const HandleEdit& edit, int dimension);
v1::Pose ToProto(const PoseUpdate& update, int dimension, uint64_t sequence,
                 uint64_t rig_changes = 0);

// The bytes of a model as the upload holds them: doubles, then corners.
class ModelBytes {
 public:
  explicit ModelBytes(const ModelArrays& model);
  int64_t size() const;
  // Bytes [offset, offset + count); count > 0 and within size().
  std::string Range(int64_t offset, int64_t count) const;

 private:
  std::vector<double> positions_;
  std::vector<uint32_t> corners_;
};

}  // namespace deform
