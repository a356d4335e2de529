#include "client/cpp/client.h"

#include <grpcpp/create_channel.h>
#include <zlib.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "client/cpp/client_impl.h"
#include "client/cpp/convert.h"
#include "client/cpp/deform_call_impl.h"
#include "client/cpp/deform_stream_impl.h"
#include "client/cpp/status.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

constexpr int64_t kUploadChunkBytes = int64_t{1} << 20;

// Frames are large and few: wide windows and HTTP/2 frames, no probing of the
// connection's speed. Connections come back fast and are watched with pings.
grpc::ChannelArguments ChannelArguments() {
  grpc::ChannelArguments arguments;
  arguments.SetInt("grpc.http2.lookahead_bytes", 16 << 20);
  arguments.SetInt("grpc.http2.max_frame_size", (1 << 24) - 1);
  arguments.SetInt("grpc.http2.bdp_probe", 0);
  arguments.SetInt("grpc.http2.max_pings_without_data", 0);
  arguments.SetInt("grpc.keepalive_time_ms", 20000);
  arguments.SetInt("grpc.initial_reconnect_backoff_ms", 50);
  arguments.SetInt("grpc.min_reconnect_backoff_ms", 50);
  arguments.SetInt("grpc.max_reconnect_backoff_ms", 500);
  // What a server answers was asked for, however long its lists are.
  arguments.SetMaxReceiveMessageSize(-1);
  return arguments;
}

// The progress that a message tells, if it does. Who gives up has the call
// cancelled.
template <typename Response>
void PassOn(const Response& response, const ProgressCallback& progress,
            grpc::ClientContext& context) {
  if (!response.has_progress() || !progress) return;
  const auto& told = response.progress();
  if (!progress(static_cast<int64_t>(told.points_done()),
                static_cast<int64_t>(told.points_total()))) {
    context.TryCancel();
  }
}

bool Holds(const DeformOptions& options, Needs what) {
  switch (what) {
    case Needs::kNothing:
      return true;
    case Needs::kWeights:
      return options.weights.binding != nullptr;
    case Needs::kBasis:
      return options.basis.basis != nullptr;
  }
  return false;
}

v1::Join JoinOf(absl::string_view session_id, const std::string& tenant,
                const DeformOptions& wanted) {
  v1::Join join;
  join.set_tenant(tenant);
  join.set_session_id(ToString(session_id));
  join.set_delivery(wanted.delivery == Delivery::kEvery ? v1::DELIVERY_EVERY
                                                        : v1::DELIVERY_LATEST);
  join.set_role(wanted.role == ParticipantRole::kViewer ? v1::ROLE_VIEWER
                                                        : v1::ROLE_EDITOR);
  join.set_name(wanted.name);
  join.set_presence(wanted.on_participants != nullptr);
  join.set_max_fps(wanted.max_fps);
  join.set_normals(wanted.normals);
  if (wanted.tolerance) join.set_tolerance(*wanted.tolerance);
  if (wanted.tolerance_fraction) {
    join.set_tolerance_fraction(*wanted.tolerance_fraction);
  }
  join.mutable_held()->set_binding_id(wanted.weights.binding_id);
  join.mutable_held()->set_basis_id(wanted.basis.basis_id);
  join.mutable_encodings()->Add(wanted.encodings.begin(),
                                wanted.encodings.end());
  if (!wanted.encodings.empty()) return join;
  const bool inexact = wanted.tolerance || wanted.tolerance_fraction;
  join.set_cheapest_encoding(inexact || wanted.weights.binding != nullptr);
  for (const FrameEncoding* encoding : AllEncodings()) {
    if (!inexact && !encoding->is_exact()) continue;
    if (Holds(wanted, encoding->needs())) {
      join.add_encodings(ToString(encoding->id()));
    }
  }
  return join;
}

}  // namespace

absl::StatusOr<Client> Client::Connect(absl::string_view target,
                                       const ClientOptions& options) {
  grpc::ChannelArguments arguments = ChannelArguments();
  if (options.own_connection) {
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  }
  const std::shared_ptr<grpc::Channel> channel = grpc::CreateCustomChannel(
      ToString(target), grpc::InsecureChannelCredentials(), arguments);
  if (!channel->WaitForConnected(std::chrono::system_clock::now() +
                                 options.connect_timeout)) {
    return MakeError(absl::StatusCode::kUnavailable,
                     absl::StrCat("no server answers at ", target),
                     {.reason = "SERVER_UNREACHABLE"});
  }
  return Client(std::make_shared<Impl>(channel, options));
}

absl::StatusOr<ModelInfo> Client::RegisterModel(
    const ModelArrays& model, absl::string_view display_name,
    const ProgressCallback& progress) {
  const ModelBytes bytes(model);
  grpc::ClientContext context;
  v1::RegisterModelResponse response;
  const auto call = impl_->models->RegisterModel(&context, &response);
  v1::RegisterModelRequest request;
  v1::ModelHeader& header = *request.mutable_header();
  header.set_tenant(impl_->options.tenant);
  header.set_display_name(ToString(display_name));
  header.set_dimension(static_cast<uint32_t>(model.dimension));
  header.set_vertex_count(model.positions.rows());
  header.set_face_count(model.faces.rows());
  bool open = call->Write(request);
  for (int64_t offset = 0; open && offset < bytes.size();) {
    const int64_t count = std::min(kUploadChunkBytes, bytes.size() - offset);
    v1::ModelChunk& chunk = *request.mutable_chunk();
    chunk.set_offset(offset);
    chunk.set_data(bytes.Range(offset, count));
    chunk.set_crc32(static_cast<uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(chunk.data().data()),
              static_cast<uInt>(count))));
    open = call->Write(request);
    offset += count;
    if (open && progress && !progress(offset, bytes.size())) {
      context.TryCancel();
      break;
    }
  }
  if (open) call->WritesDone();
  DEFORM_RETURN_IF_ERROR(FromGrpc(call->Finish()));
  ModelInfo info = FromProto(response.model());
  info.existed = response.existed();
  return info;
}

absl::StatusOr<ModelInfo> Client::GetModel(absl::string_view model_id) {
  v1::GetModelRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_model_id(ToString(model_id));
  v1::GetModelResponse response;
  DEFORM_RETURN_IF_ERROR(impl_->Call(
      *impl_->models, &v1::ModelService::Stub::GetModel, request, &response));
  return FromProto(response.model());
}

absl::StatusOr<std::vector<ModelInfo>> Client::ListModels() {
  std::vector<ModelInfo> models;
  DEFORM_RETURN_IF_ERROR(impl_->CallPages<v1::ListModelsResponse>(
      *impl_->models, &v1::ModelService::Stub::ListModels,
      v1::ListModelsRequest(), [&](const v1::ListModelsResponse& page) {
        for (const v1::Model& model : page.models()) {
          models.push_back(FromProto(model));
        }
      }));
  return models;
}

absl::Status Client::DeleteModel(absl::string_view model_id) {
  v1::DeleteModelRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_model_id(ToString(model_id));
  v1::DeleteModelResponse response;
  return impl_->Call(*impl_->models, &v1::ModelService::Stub::DeleteModel,
                     request, &response);
}

absl::StatusOr<BindingInfo> Client::CreateBinding(
    const BindingSpec& spec, const ProgressCallback& progress) {
  const v1::CreateBindingRequest request = ToProto(spec, impl_->options.tenant);
  grpc::ClientContext context;
  const auto call = impl_->bindings->CreateBinding(&context, request);
  v1::CreateBindingResponse response;
  std::optional<BindingInfo> info;
  while (call->Read(&response)) {
    if (response.has_binding()) info = FromProto(response.binding());
    PassOn(response, progress, context);
  }
  DEFORM_RETURN_IF_ERROR(FromGrpc(call->Finish()));
  if (!info) return absl::InternalError("the server ended without a binding");
  return *std::move(info);
}

absl::StatusOr<EditedBinding> Client::EditHandles(
    absl::string_view binding_id, std::span<const HandleEdit> edits,
    const EditOptions& options, const ProgressCallback& progress) {
  DEFORM_ASSIGN_OR_RETURN(const BindingInfo before, GetBinding(binding_id));
  v1::EditHandlesRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_binding_id(before.binding_id);
  for (const HandleEdit& edit : edits) {
    *request.add_edits() = ToProto(edit, before.dimension);
  }
  request.mutable_session_ids()->Add(options.sessions.begin(),
                                     options.sessions.end());
  request.set_keep_sessions(options.keep_sessions);
  grpc::ClientContext context;
  const auto call = impl_->bindings->EditHandles(&context, request);
  v1::EditHandlesResponse response;
  std::optional<EditedBinding> edited;
  while (call->Read(&response)) {
    if (response.has_edited()) edited = FromProto(response.edited());
    PassOn(response, progress, context);
  }
  DEFORM_RETURN_IF_ERROR(FromGrpc(call->Finish()));
  if (!edited) return absl::InternalError("the server ended without a binding");
  return *std::move(edited);
}

absl::StatusOr<BindingInfo> Client::GetBinding(absl::string_view binding_id) {
  DEFORM_ASSIGN_OR_RETURN(const v1::GetBindingResponse response,
                          impl_->GetBinding(binding_id, false));
  return FromProto(response.binding());
}

absl::StatusOr<RigArrays> Client::GetRig(absl::string_view binding_id) {
  DEFORM_ASSIGN_OR_RETURN(const v1::GetBindingResponse response,
                          impl_->GetBinding(binding_id, true));
  return FromProto(response.rig());
}

absl::StatusOr<std::vector<BindingInfo>> Client::ListBindings(
    absl::string_view model_id) {
  std::vector<BindingInfo> bindings;
  v1::ListBindingsRequest request;
  request.set_model_id(ToString(model_id));
  DEFORM_RETURN_IF_ERROR(impl_->CallPages<v1::ListBindingsResponse>(
      *impl_->bindings, &v1::BindingService::Stub::ListBindings, request,
      [&](const v1::ListBindingsResponse& page) {
        for (const v1::Binding& binding : page.bindings()) {
          bindings.push_back(FromProto(binding));
        }
      }));
  return bindings;
}

absl::Status Client::DeleteBinding(absl::string_view binding_id) {
  v1::DeleteBindingRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_binding_id(ToString(binding_id));
  v1::DeleteBindingResponse response;
  return impl_->Call(*impl_->bindings, &v1::BindingService::Stub::DeleteBinding,
                     request, &response);
}

absl::StatusOr<QualityInfo> Client::GetQuality(
    const QualityQuery& query, const ProgressCallback& progress) {
  v1::GetQualityRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_binding_id(query.binding_id);
  request.set_max_points(static_cast<uint32_t>(
      std::clamp<int64_t>(query.max_points, 0, UINT32_MAX)));
  request.set_with_points(query.with_points);
  if (query.pose) {
    DEFORM_ASSIGN_OR_RETURN(const BindingInfo binding,
                            GetBinding(query.binding_id));
    *request.mutable_pose() = ToProto(*query.pose, binding.dimension, 0);
  } else if (!query.session_id.empty()) {
    request.set_session_id(query.session_id);
  }
  grpc::ClientContext context;
  const auto call = impl_->bindings->GetQuality(&context, request);
  v1::GetQualityResponse response;
  absl::StatusOr<QualityInfo> info =
      absl::InternalError("the server ended without a report");
  while (call->Read(&response)) {
    PassOn(response, progress, context);
    if (response.has_report()) {
      info = FromProto(response.report());
    } else if (response.has_points() && info.ok()) {
      const absl::Status added = AddPoints(response.points(), *info);
      if (!added.ok()) info = added;
    }
  }
  DEFORM_RETURN_IF_ERROR(FromGrpc(call->Finish()));
  return info;
}

absl::StatusOr<std::vector<SchemeInfo>> Client::ListSchemes() {
  v1::ListSchemesResponse response;
  DEFORM_RETURN_IF_ERROR(impl_->Call(*impl_->bindings,
                                     &v1::BindingService::Stub::ListSchemes,
                                     v1::ListSchemesRequest(), &response));
  std::vector<SchemeInfo> schemes;
  for (const v1::Scheme& scheme : response.schemes()) {
    schemes.push_back(FromProto(scheme));
  }
  return schemes;
}

absl::StatusOr<SessionInfo> Client::CreateSession(
    absl::string_view binding_id, absl::string_view session_id) {
  v1::CreateSessionRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_binding_id(ToString(binding_id));
  request.set_session_id(ToString(session_id));
  v1::CreateSessionResponse response;
  DEFORM_RETURN_IF_ERROR(impl_->Call(*impl_->sessions,
                                     &v1::SessionService::Stub::CreateSession,
                                     request, &response));
  return FromProto(response.session());
}

absl::StatusOr<SessionInfo> Client::GetSession(absl::string_view session_id) {
  v1::GetSessionRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_session_id(ToString(session_id));
  v1::GetSessionResponse response;
  DEFORM_RETURN_IF_ERROR(impl_->Call(*impl_->sessions,
                                     &v1::SessionService::Stub::GetSession,
                                     request, &response));
  return FromProto(response.session());
}

absl::StatusOr<std::vector<SessionInfo>> Client::ListSessions() {
  std::vector<SessionInfo> sessions;
  DEFORM_RETURN_IF_ERROR(impl_->CallPages<v1::ListSessionsResponse>(
      *impl_->sessions, &v1::SessionService::Stub::ListSessions,
      v1::ListSessionsRequest(), [&](const v1::ListSessionsResponse& page) {
        for (const v1::Session& session : page.sessions()) {
          sessions.push_back(FromProto(session));
        }
      }));
  return sessions;
}

absl::Status Client::DeleteSession(absl::string_view session_id) {
  v1::DeleteSessionRequest request;
  request.set_tenant(impl_->options.tenant);
  request.set_session_id(ToString(session_id));
  v1::DeleteSessionResponse response;
  return impl_->Call(*impl_->sessions, &v1::SessionService::Stub::DeleteSession,
                     request, &response);
}

absl::StatusOr<ServerStatus> Client::GetServerStatus() {
  v1::GetServerStatusResponse response;
  DEFORM_RETURN_IF_ERROR(impl_->Call(*impl_->server,
                                     &v1::ServerService::Stub::GetServerStatus,
                                     v1::GetServerStatusRequest(), &response));
  return FromProto(response.status());
}

absl::StatusOr<std::string> Client::Backup(absl::string_view name) {
  v1::BackupRequest request;
  request.set_name(std::string(name));
  v1::BackupResponse response;
  DEFORM_RETURN_IF_ERROR(impl_->Call(
      *impl_->server, &v1::ServerService::Stub::Backup, request, &response));
  return response.directory();
}

absl::StatusOr<DeformStream> Client::Deform(absl::string_view session_id,
                                            const DeformOptions& options) {
  auto stream = std::make_unique<DeformStream::Impl>(
      std::shared_ptr<v1::SessionService::Stub>(impl_, impl_->sessions.get()),
      JoinOf(session_id, impl_->options.tenant, options), options);
  DEFORM_RETURN_IF_ERROR(stream->Join());
  return DeformStream(std::move(stream));
}

absl::StatusOr<DeformStream> Client::Deform(absl::string_view session_id,
                                            Delivery delivery) {
  return Deform(session_id, DeformOptions{.delivery = delivery});
}

std::unique_ptr<DeformCall> Client::StartDeform(absl::string_view session_id,
                                                const DeformOptions& options,
                                                DeformEvents& events) {
  return StartDeformCall(*impl_->sessions,
                         JoinOf(session_id, impl_->options.tenant, options),
                         options, events);
}

}  // namespace deform
