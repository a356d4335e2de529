// Between the messages of deform/v1 and the values of the rooms behind.
//
// What comes from outside is checked here as far as its shape goes, so that
// what is handed on is a value; the rooms check what it means. Every refusal is
// an InvalidArgument that names the field.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/deform/pose.h"
#include "core/weights/handle_edit.h"
#include "deform/v1/binding.pb.h"
#include "deform/v1/model.pb.h"
#include "deform/v1/quality.pb.h"
#include "deform/v1/session.pb.h"
#include "server/models/binding_registry.h"
#include "server/models/model_registry.h"
#include "server/models/model_upload.h"
#include "server/sessions/session.h"

namespace deform::server {

// PAGE_TOO_LARGE, BAD_PAGE_TOKEN.
absl::StatusOr<PageRequest> ToPageRequest(uint32_t page_size,
                                          const std::string& page_token);

// NAME_TOO_LONG for the display name; counts are ModelUpload's to check.
absl::StatusOr<ModelUpload::Header> FromProto(const v1::ModelHeader& header);

// BAD_NAME, MISSING_FIELD (scheme, rig), WRONG_LENGTH, BAD_DIMENSION,
// INDEX_OUT_OF_RANGE, UNKNOWN_VALUE, WRONG_RIG, WEIGHT_TOLERANCE_OUT_OF_RANGE,
// and what Cage and Handles refuse. `model` is read if the request wants
// handles at its box; `weight_tolerance` holds if it names none.
absl::StatusOr<BindSpec> FromProto(const v1::CreateBindingRequest& request,
                                   const Mesh* model = nullptr,
                                   double weight_tolerance = 0);

// WRONG_LENGTH, INDEX_OUT_OF_RANGE; CheckPoseUpdate() checks the rest.
absl::StatusOr<PoseUpdate> FromProto(const v1::Pose& pose, int dimension);

struct EditRequest {
  std::string tenant;
  std::string binding_id;
  std::vector<std::string> sessions;  // Each once; empty: all, or none.
  bool keep_sessions = false;
};
// All but the edits. BAD_NAME, CONTRADICTION (sessions named and kept).
absl::StatusOr<EditRequest> FromProto(const v1::EditHandlesRequest& request);
// MISSING_FIELD, WRONG_LENGTH; EditHandles() checks the rest.
absl::StatusOr<std::vector<HandleEdit>> FromProto(
    const google::protobuf::RepeatedPtrField<v1::HandleEdit>& edits,
    int dimension);

struct JoinRequest {
  std::string tenant;
  std::string session_id;
  Delivery delivery = Delivery::kLatest;
  FrameWishes frames;  // Encodings are those that are known.
};
// BAD_NAME, UNKNOWN_VALUE (delivery), UNKNOWN_ENCODING.
absl::StatusOr<JoinRequest> FromProto(const v1::Join& join);
absl::StatusOr<WeightsId> FromProto(const v1::HeldWeights& held);

// As far as its shape goes: BAD_TOKEN (longer than 64 bytes), UNKNOWN_VALUE
// (role).
absl::StatusOr<Introduction> IntroductionOf(const v1::Join& join);
// INDEX_OUT_OF_RANGE beyond 2^31; Roster checks the rest.
absl::StatusOr<Shown> FromProto(const v1::Presence& presence);
absl::StatusOr<std::vector<int32_t>> ToHandles(
    const google::protobuf::RepeatedField<uint32_t>& vertices,
    absl::string_view field);
PoseTerms TermsOf(const v1::Pose& pose);

void ToProto(const ModelRecord& record, v1::Model* model);
// In full, or without the lists that grow with the model.
enum class Detail { kFull, kSummary };
void ToProto(const BindingRecord& record, Detail detail, v1::Binding* binding);
void ToProto(const BindProgress& progress, v1::BindingProgress* out);
void ToProto(const BindQuality& quality, v1::BindingQuality* out);
void ToProto(const Rig& rig, v1::Rig* out);
void ToProto(const SessionState& state, v1::Session* session);
void ToProto(const CoordinateScheme& scheme, v1::Scheme* out);
void ToProto(const Session::Joined& joined, v1::Joined* out);
void ToProto(const RigChange& change, v1::RigChanged* out);
void ToProto(const Rejection& rejection, v1::PoseRejected* out);
void ToProto(const Acknowledgement& acknowledgement, v1::Acknowledged* out);
// `now` is of the sessions' clock: locks tell how long they last.
void ToProto(const PresenceChange& change,
             std::chrono::steady_clock::time_point now, v1::Participants* out);

}  // namespace deform::server
