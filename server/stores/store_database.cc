#include "server/stores/store_database.h"

#include <utility>

#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "server/stores/array_shelf.h"
#include "server/stores/row_bytes.h"
#include "server/stores/store_errors.h"

namespace deform::server {
namespace {

StoreKey KeyAt(const Statement& row, int column) {
  return {row.Text(column), row.Text(column + 1)};
}

Statement& BindKey(Statement& statement, const StoreKey& key) {
  return statement.Bind(key.tenant).Bind(key.id);
}

}  // namespace

absl::StatusOr<StoreContents> StoreDatabase::Load() {
  StoreContents contents;
  const auto take = [&](absl::string_view type, const StoreKey& key, auto row,
                        auto& rows) {
    if (row) {
      rows.push_back(*std::move(row));
    } else {
      contents.damaged.push_back(EntryDamaged(type, key));
    }
  };
  const auto read = [&](const char* sql, auto each) -> absl::Status {
    Statement row = database_->Prepare(sql);
    while (true) {
      DEFORM_ASSIGN_OR_RETURN(const bool more, row.Step());
      if (!more) return absl::OkStatus();
      each(KeyAt(row, 0), row.Blob(2));
    }
  };
  DEFORM_RETURN_IF_ERROR(
      read("SELECT tenant, id, body FROM models ORDER BY tenant, id",
           [&](const StoreKey& key, auto body) {
             take("model", key, DecodeModel(key, body), contents.models);
           }));
  DEFORM_RETURN_IF_ERROR(
      read("SELECT tenant, id, body FROM bindings ORDER BY tenant, id",
           [&](const StoreKey& key, auto body) {
             take("binding", key, DecodeBinding(key, body), contents.bindings);
           }));
  DEFORM_RETURN_IF_ERROR(
      read("SELECT tenant, id, body FROM sessions ORDER BY tenant, id",
           [&](const StoreKey& key, auto body) {
             take("session", key, DecodeSession(key, body), contents.sessions);
           }));
  return contents;
}

absl::Status StoreDatabase::PutModel(const StoredModel& model) {
  const std::string body = Encode(model);
  Statement put = database_->Prepare(
      "INSERT INTO models(tenant, id, body) VALUES(?, ?, ?) "
      "ON CONFLICT DO UPDATE SET body = excluded.body");
  return BindKey(put, model.key).BindBlob(body).Run();
}

absl::StatusOr<bool> StoreDatabase::HasModel(const StoreKey& key) {
  Statement find =
      database_->Prepare("SELECT 1 FROM models WHERE tenant = ? AND id = ?");
  return BindKey(find, key).Step();
}

absl::Status StoreDatabase::AddKeys(const char* sql, const StoreKey& key,
                                    std::vector<StoreKey>& found) {
  Statement row = database_->Prepare(sql);
  BindKey(row, key);
  while (true) {
    DEFORM_ASSIGN_OR_RETURN(const bool more, row.Step());
    if (!more) return absl::OkStatus();
    found.push_back(KeyAt(row, 0));
  }
}

absl::StatusOr<StoreDatabase::Deleted> StoreDatabase::DeleteModel(
    const StoreKey& key) {
  Deleted deleted{.files = {ModelFile(key)}};
  const auto remove = [&]() -> absl::Status {
    std::vector<StoreKey> bindings;
    DEFORM_RETURN_IF_ERROR(
        AddKeys("SELECT tenant, id FROM bindings "
                "WHERE tenant = ? AND model_id = ?",
                key, bindings));
    for (const StoreKey& binding : bindings) {
      DEFORM_RETURN_IF_ERROR(DeleteBindingInto(binding, deleted));
    }
    Statement remove_model =
        database_->Prepare("DELETE FROM models WHERE tenant = ? AND id = ?");
    DEFORM_RETURN_IF_ERROR(BindKey(remove_model, key).Run());
    return database_->changes() > 0 ? absl::OkStatus()
                                    : NotStored("model", key);
  };
  DEFORM_RETURN_IF_ERROR(Atomically(remove));
  return deleted;
}

absl::Status StoreDatabase::PutBinding(const StoredBinding& binding) {
  DEFORM_ASSIGN_OR_RETURN(const bool has_model,
                          HasModel({binding.key.tenant, binding.model_id}));
  if (!has_model) {
    return NotStored("model", {binding.key.tenant, binding.model_id});
  }
  const std::string body = Encode(binding);
  Statement put = database_->Prepare(
      "INSERT INTO bindings(tenant, id, model_id, body) VALUES(?, ?, ?, ?) "
      "ON CONFLICT DO UPDATE SET "
      "model_id = excluded.model_id, body = excluded.body");
  return BindKey(put, binding.key).Bind(binding.model_id).BindBlob(body).Run();
}

absl::StatusOr<bool> StoreDatabase::HasBinding(const StoreKey& key) {
  Statement find =
      database_->Prepare("SELECT 1 FROM bindings WHERE tenant = ? AND id = ?");
  return BindKey(find, key).Step();
}

absl::StatusOr<std::optional<WeightsForm>> StoreDatabase::WeightsOf(
    const StoreKey& binding) {
  Statement find = database_->Prepare(
      "SELECT weights FROM bindings WHERE tenant = ? AND id = ?");
  DEFORM_ASSIGN_OR_RETURN(const bool found, BindKey(find, binding).Step());
  if (!found) return NotStored("binding", binding);
  if (find.IsNull(0)) return std::optional<WeightsForm>();
  return DecodeForm(binding, find.Blob(0));
}

absl::StatusOr<std::optional<WeightsForm>> StoreDatabase::SetWeights(
    const StoreKey& binding, const WeightsForm& form) {
  DEFORM_ASSIGN_OR_RETURN(auto before, WeightsOf(binding));
  const std::string weights = Encode(form, binding);
  Statement set = database_->Prepare(
      "UPDATE bindings SET weights = ? WHERE tenant = ? AND id = ?");
  DEFORM_RETURN_IF_ERROR(BindKey(set.BindBlob(weights), binding).Run());
  return before;
}

absl::StatusOr<StoreDatabase::Deleted> StoreDatabase::DeleteBinding(
    const StoreKey& key) {
  Deleted deleted;
  const auto remove = [&] { return DeleteBindingInto(key, deleted); };
  DEFORM_RETURN_IF_ERROR(Atomically(remove));
  return deleted;
}

absl::Status StoreDatabase::DeleteBindingInto(const StoreKey& key,
                                              Deleted& deleted) {
  DEFORM_ASSIGN_OR_RETURN(const auto form, WeightsOf(key));
  if (form) deleted.files.push_back(WeightsFile(key, *form));
  DEFORM_RETURN_IF_ERROR(
      AddKeys("SELECT tenant, id FROM sessions "
              "WHERE tenant = ? AND binding_id = ?",
              key, deleted.sessions));
  Statement remove =
      database_->Prepare("DELETE FROM bindings WHERE tenant = ? AND id = ?");
  return BindKey(remove, key).Run();
}

absl::StatusOr<bool> StoreDatabase::RefersTo(const std::string& file) {
  const std::vector<std::string> parts = absl::StrSplit(file, '/');
  if (parts.size() != 3) return false;
  if (parts[0] == "models") return HasModel({parts[1], parts[2]});
  const StoreKey binding = {parts[1], parts[2].substr(0, parts[2].find('.'))};
  const auto form = WeightsOf(binding);
  if (absl::IsNotFound(form.status())) return false;
  if (!form.ok()) return form.status();
  return form->has_value() && WeightsFile(binding, **form) == file;
}

absl::StatusOr<std::vector<std::string>> StoreDatabase::Files() {
  std::vector<std::string> files;
  Statement row = database_->Prepare(
      "SELECT tenant, id, NULL FROM models UNION ALL "
      "SELECT tenant, id, weights FROM bindings WHERE weights IS NOT NULL");
  while (true) {
    DEFORM_ASSIGN_OR_RETURN(const bool more, row.Step());
    if (!more) return files;
    const StoreKey key = KeyAt(row, 0);
    if (row.IsNull(2)) {
      files.push_back(ModelFile(key));
    } else if (const auto form = DecodeForm(key, row.Blob(2))) {
      files.push_back(WeightsFile(key, *form));
    }
  }
}

}  // namespace deform::server
