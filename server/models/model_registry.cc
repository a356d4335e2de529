#include "server/models/model_registry.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/content_id.h"
#include "server/models/mesh_arrays.h"

namespace deform::server {
namespace {

// Tenants do not share ids: an id tells nothing about what others have.
std::string ModelId(const std::string& tenant, const Mesh& mesh) {
  return "m-" + ContentHash("model")
                    .Add(tenant)
                    .Add(int64_t{mesh.dimension()})
                    .Add(mesh.positions())
                    .Add(mesh.faces())
                    .Finish();
}

int64_t BytesOf(const Mesh& mesh) {
  return mesh.positions().size() * int64_t{sizeof(double)} +
         mesh.faces().size() * int64_t{sizeof(int32_t)};
}

}  // namespace

absl::StatusOr<Losses> ModelRegistry::Load(
    const std::vector<StoredModel>& models) {
  Losses losses;
  for (const StoredModel& model : models) {
    const auto& [tenant, id] = model.key;
    const absl::Status status = LoadOne(model);
    if (absl::IsDataLoss(status)) {
      losses.push_back(Damaged("model", id, status, "register it again"));
      models_.Lose(tenant, id, losses.back());
    } else if (!status.ok()) {
      return Annotate(status, absl::StrCat("model ", id, ": "));
    }
  }
  return losses;
}

absl::Status ModelRegistry::LoadOne(const StoredModel& model) {
  DEFORM_ASSIGN_OR_RETURN(const StoredArrays arrays,
                          store_.ModelArrays(model.key));
  auto record = std::make_shared<ModelRecord>();
  record->tenant = model.key.tenant;
  record->id = model.key.id;
  record->display_name = model.display_name;
  record->create_time = model.create_time;
  int64_t bytes = 0;
  for (const auto& array : arrays.arrays) bytes += std::ssize(array.bytes);
  DEFORM_ASSIGN_OR_RETURN(record->memory,
                          budget_.Reserve(bytes, "the stored model needs"));
  absl::StatusOr<Mesh> mesh = MeshFrom(arrays);
  // What Mesh::Create() refuses was not written by us either.
  if (!mesh.ok()) return absl::DataLossError(mesh.status().message());
  DEFORM_RETURN_IF_ERROR(
      record->memory.Resize(BytesOf(*mesh), "the stored model needs"));
  record->mesh = std::make_shared<const Mesh>(*std::move(mesh));
  return models_.Insert(model.key.tenant, model.key.id, std::move(record))
      .status();
}

absl::StatusOr<ModelRegistry::Registered> ModelRegistry::Register(
    const std::string& tenant, const std::string& display_name, Mesh mesh) {
  const std::string id = ModelId(tenant, mesh);
  const Claims::Claim claim = claims_.Take(tenant, id);
  auto found = models_.Find(tenant, id);
  if (found.ok()) return Registered{*std::move(found), true};
  auto record = std::make_shared<ModelRecord>();
  record->tenant = tenant;
  record->id = id;
  record->display_name = display_name;
  DEFORM_ASSIGN_OR_RETURN(record->memory,
                          budget_.Reserve(BytesOf(mesh), "the model needs"));
  record->mesh = std::make_shared<const Mesh>(std::move(mesh));
  record->create_time = TimeToStore();
  const StoreKey key{tenant, id};
  DEFORM_RETURN_IF_ERROR(store_.PutModel({.key = key,
                                          .display_name = display_name,
                                          .create_time = record->create_time},
                                         ArraysOf(record->mesh)));
  auto inserted = models_.Insert(tenant, id, std::move(record));
  if (!inserted.ok()) {
    // What is lost stays in the store, with what depends on it. If this fails,
    // the next server finds one model more than it may have.
    if (!absl::IsDataLoss(found.status())) {
      store_.DeleteModel(key).IgnoreError();
    }
    return inserted.status();
  }
  return Registered{std::move(inserted->first), inserted->second};
}

absl::Status ModelRegistry::Remove(const std::string& tenant,
                                   const std::string& id) {
  const Claims::Claim claim = claims_.Take(tenant, id);
  return models_
      .Remove(tenant, id,
              [&] {
                return store_.DeleteModel({tenant, id});
              })
      .status();
}

}  // namespace deform::server
