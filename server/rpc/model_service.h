// deform.v1.ModelService over the registry of models.
#pragma once

#include "deform/v1/model.grpc.pb.h"
#include "server/models/model_registry.h"
#include "server/rpc/calls.h"

namespace deform::server {

class ModelService final : public v1::ModelService::Service {
 public:
  // Both are borrowed.
  ModelService(CallRunner& calls, ModelRegistry& models)
      : calls_(calls), models_(models) {}

  grpc::Status RegisterModel(
      grpc::ServerContext* context,
      grpc::ServerReader<v1::RegisterModelRequest>* reader,
      v1::RegisterModelResponse* response) override;
  grpc::Status GetModel(grpc::ServerContext* context,
                        const v1::GetModelRequest* request,
                        v1::GetModelResponse* response) override;
  grpc::Status DownloadModel(
      grpc::ServerContext* context, const v1::DownloadModelRequest* request,
      grpc::ServerWriter<v1::DownloadModelResponse>* writer) override;
  grpc::Status ListModels(grpc::ServerContext* context,
                          const v1::ListModelsRequest* request,
                          v1::ListModelsResponse* response) override;
  grpc::Status DeleteModel(grpc::ServerContext* context,
                           const v1::DeleteModelRequest* request,
                           v1::DeleteModelResponse* response) override;

 private:
  CallRunner& calls_;
  ModelRegistry& models_;
};

}  // namespace deform::server
