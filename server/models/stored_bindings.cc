// Bindings in the store: put there before anyone learns of them, brought in at
// the start.
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/binding_bytes.h"
#include "server/models/binding_registry.h"
#include "server/stores/bytes.h"

namespace deform::server {

absl::StatusOr<CreatedBinding> BindingRegistry::Keep(
    std::shared_ptr<const BindingRecord> record,
    std::shared_ptr<const Binding> binding) {
  const StoreKey key{record->tenant, record->id};
  const Claims::Claim claim = claims_.Take(key.tenant, key.id);
  const absl::Status before = bindings_.Find(key.tenant, key.id).status();
  if (!before.ok()) {
    DEFORM_RETURN_IF_ERROR(
        store().PutBinding({.key = key,
                            .model_id = record->model_id,
                            .create_time = record->create_time,
                            .request = EncodeRequest(record->facts.request(),
                                                     record->weight_tolerance),
                            .facts = EncodeFacts(record->facts)}));
  }
  auto inserted = bindings_.Insert(key.tenant, key.id, std::move(record));
  if (!inserted.ok()) {
    // What is lost stays in the store, with its sessions.
    if (!absl::IsDataLoss(before)) store().DeleteBinding(key).IgnoreError();
    return inserted.status();
  }
  return CreatedBinding{std::move(inserted->first), std::move(binding),
                        inserted->second};
}

absl::StatusOr<Losses> BindingRegistry::Load(
    const std::vector<StoredBinding>& bindings) {
  Losses losses;
  for (const StoredBinding& binding : bindings) {
    const auto& [tenant, id] = binding.key;
    const absl::Status status = LoadOne(binding);
    if (absl::IsDataLoss(status) || absl::IsNotFound(status)) {
      losses.push_back(Damaged("binding", id, status, "create it again"));
      bindings_.Lose(tenant, id, losses.back());
    } else if (!status.ok()) {
      return Annotate(status, absl::StrCat("binding ", id, ": "));
    }
  }
  return losses;
}

absl::Status BindingRegistry::LoadOne(const StoredBinding& stored) {
  const auto& [tenant, id] = stored.key;
  DEFORM_ASSIGN_OR_RETURN(
      auto model, models_.catalogue().Use(tenant, stored.model_id,
                                          absl::StrCat("binding ", id)));
  DEFORM_ASSIGN_OR_RETURN(
      DecodedRequest decoded,
      DecodeRequest(AsBytes(stored.request), model.record()->mesh));
  DEFORM_ASSIGN_OR_RETURN(
      BindingFacts facts,
      DecodeFacts(AsBytes(stored.facts), std::move(decoded.request)));
  DEFORM_ASSIGN_OR_RETURN(
      auto memory,
      budget().Reserve(facts.bytes(), "what is stored of the binding needs"));
  auto record = std::make_shared<const BindingRecord>(
      BindingRecord{.tenant = tenant,
                    .id = id,
                    .model_id = stored.model_id,
                    .weight_tolerance = decoded.weight_tolerance,
                    .facts = std::move(facts),
                    .weights = weights_.MakeSlot(),
                    .create_time = stored.create_time,
                    .memory = std::move(memory),
                    .model = std::move(model)});
  return bindings_.Insert(tenant, id, std::move(record)).status();
}

}  // namespace deform::server
