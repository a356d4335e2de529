#include "client/cli/things.h"

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform::cli {
namespace {

// An id that has another form than this kind of thing is not found either.
bool IsElsewhere(const absl::Status& status) {
  return absl::IsNotFound(status) || absl::IsInvalidArgument(status);
}

}  // namespace

absl::StatusOr<Thing> FindThing(Client& client, const std::string& id) {
  const absl::StatusOr<BindingInfo> binding = client.GetBinding(id);
  if (binding.ok()) return Thing(*binding);
  if (!IsElsewhere(binding.status())) return binding.status();
  const absl::StatusOr<ModelInfo> model = client.GetModel(id);
  if (model.ok()) return Thing(*model);
  if (!IsElsewhere(model.status())) return model.status();
  const absl::StatusOr<SessionInfo> session = client.GetSession(id);
  if (session.ok()) return Thing(*session);
  if (!IsElsewhere(session.status())) return session.status();
  return MakeError(
      absl::StatusCode::kNotFound,
      absl::StrCat("the server has no model, binding or session '", id, "'"),
      {.reason = "ID_NOT_FOUND", .resource_name = id});
}

const char* KindOf(const Thing& thing) {
  constexpr const char* kKinds[] = {"model", "binding", "session"};
  return kKinds[thing.index()];
}

absl::Status DeleteThing(Client& client, const Thing& thing) {
  if (const auto* model = std::get_if<ModelInfo>(&thing)) {
    return client.DeleteModel(model->model_id);
  }
  if (const auto* binding = std::get_if<BindingInfo>(&thing)) {
    return client.DeleteBinding(binding->binding_id);
  }
  return client.DeleteSession(std::get<SessionInfo>(thing).session_id);
}

}  // namespace deform::cli
