#include "server/models/model_registry.h"

#include <utility>

#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/models/content_id.h"

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

absl::StatusOr<ModelRegistry::Registered> ModelRegistry::Register(
    const std::string& tenant, const std::string& display_name, Mesh mesh) {
  const std::string id = ModelId(tenant, mesh);
  if (auto found = models_.Find(tenant, id); found.ok()) {
    return Registered{*std::move(found), true};
  }
  auto record = std::make_shared<ModelRecord>();
  record->tenant = tenant;
  record->id = id;
  record->display_name = display_name;
  DEFORM_ASSIGN_OR_RETURN(record->memory,
                          budget_.Reserve(BytesOf(mesh), "the model needs"));
  record->mesh = std::make_shared<const Mesh>(std::move(mesh));
  record->create_time = absl::Now();
  DEFORM_ASSIGN_OR_RETURN(auto inserted,
                          models_.Insert(tenant, id, std::move(record)));
  return Registered{std::move(inserted.first), inserted.second};
}

}  // namespace deform::server
