#include "server/rpc/model_service.h"

#include <utility>

#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/rpc/convert.h"
#include "server/rpc/model_chunks.h"

namespace deform::server {
namespace {

using Reader = PeerReader<v1::RegisterModelRequest>;

absl::StatusOr<v1::ModelHeader> ReadHeader(Reader& reader) {
  v1::RegisterModelRequest message;
  if (!reader.Read(&message) || !message.has_header()) {
    return InvalidInput("HEADER_FIRST", "header",
                        "the first message of an upload is its header");
  }
  return std::move(*message.mutable_header());
}

absl::StatusOr<Mesh> ReadMesh(const v1::ModelHeader& header, Reader& reader,
                              ModelRegistry& models) {
  DEFORM_ASSIGN_OR_RETURN(const ModelUpload::Header counts, FromProto(header));
  DEFORM_ASSIGN_OR_RETURN(
      ModelUpload upload,
      ModelUpload::Create(counts, models.max_model_bytes(), models.budget()));
  v1::RegisterModelRequest message;
  while (reader.Read(&message)) {
    if (!message.has_chunk()) {
      return InvalidInput("CHUNK_EXPECTED", "chunk",
                          "after the header an upload has chunks only");
    }
    const v1::ModelChunk& chunk = message.chunk();
    DEFORM_RETURN_IF_ERROR(
        upload.Append(chunk.offset(), chunk.crc32(), chunk.data()));
  }
  return std::move(upload).Finish();
}

}  // namespace

grpc::Status ModelService::RegisterModel(
    grpc::ServerContext* context,
    grpc::ServerReader<v1::RegisterModelRequest>* reader,
    v1::RegisterModelResponse* response) {
  return calls_.Run("RegisterModel", *context, [&]() -> absl::Status {
    Reader peer(calls_, *context, *reader);
    DEFORM_ASSIGN_OR_RETURN(const v1::ModelHeader header, ReadHeader(peer));
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(header.tenant()));
    DEFORM_ASSIGN_OR_RETURN(Mesh mesh, ReadMesh(header, peer, models_));
    // A broken stream ends like a finished one; nothing is kept of it.
    if (context->IsCancelled()) return absl::CancelledError();
    DEFORM_ASSIGN_OR_RETURN(
        const auto registered,
        models_.Register(tenant, header.display_name(), std::move(mesh)));
    ToProto(*registered.record, response->mutable_model());
    response->set_existed(registered.existed);
    return absl::OkStatus();
  });
}

grpc::Status ModelService::GetModel(grpc::ServerContext* context,
                                    const v1::GetModelRequest* request,
                                    v1::GetModelResponse* response) {
  return calls_.Run("GetModel", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const auto record,
        models_.catalogue().Find(tenant, request->model_id()));
    ToProto(*record, response->mutable_model());
    return absl::OkStatus();
  });
}

grpc::Status ModelService::DownloadModel(
    grpc::ServerContext* context, const v1::DownloadModelRequest* request,
    grpc::ServerWriter<v1::DownloadModelResponse>* writer) {
  return calls_.Run("DownloadModel", *context, [&]() -> absl::Status {
    PeerWriter<v1::DownloadModelResponse> peer(calls_, *context, *writer);
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const auto record,
        models_.catalogue().Find(tenant, request->model_id()));
    v1::DownloadModelResponse message;
    ToProto(*record, message.mutable_model());
    if (!peer.Write(message)) return absl::CancelledError();
    const Mesh& mesh = *record->mesh;
    const int64_t bytes = BytesOfArrays(mesh);
    for (int64_t offset = 0; offset < bytes;) {
      *message.mutable_chunk() = ChunkOfArrays(mesh, offset);
      if (!peer.Write(message)) return absl::CancelledError();
      offset += std::ssize(message.chunk().data());
    }
    return absl::OkStatus();
  });
}

grpc::Status ModelService::ListModels(grpc::ServerContext* context,
                                      const v1::ListModelsRequest* request,
                                      v1::ListModelsResponse* response) {
  return calls_.Run("ListModels", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    DEFORM_ASSIGN_OR_RETURN(
        const PageRequest wanted,
        ToPageRequest(request->page_size(), request->page_token()));
    const auto page = models_.catalogue().List(
        tenant, wanted, [](const ModelRecord&) { return true; });
    for (const auto& record : page.records) {
      ToProto(*record, response->add_models());
    }
    response->set_next_page_token(page.next);
    return absl::OkStatus();
  });
}

grpc::Status ModelService::DeleteModel(grpc::ServerContext* context,
                                       const v1::DeleteModelRequest* request,
                                       v1::DeleteModelResponse* /*response*/) {
  return calls_.Run("DeleteModel", *context, [&]() -> absl::Status {
    DEFORM_ASSIGN_OR_RETURN(const std::string tenant,
                            TenantOr(request->tenant()));
    return models_.Remove(tenant, request->model_id());
  });
}

}  // namespace deform::server
