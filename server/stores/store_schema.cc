// The format of the tables, its versions, and how one becomes the next.
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/store_database.h"

namespace deform::server {
namespace {

// "dfrm" tells the file from other programs' (PRAGMA application_id).
constexpr int64_t kApplication = 0x6466726d;

// `body`, `weights`: row_bytes.h; `body` of poses: poses.h. A session has one
// whole pose and, behind it, changes in part.
constexpr char kVersion1[] = R"(
CREATE TABLE models(
  tenant TEXT NOT NULL,
  id TEXT NOT NULL,
  body BLOB NOT NULL,
  PRIMARY KEY(tenant, id));
CREATE TABLE bindings(
  tenant TEXT NOT NULL,
  id TEXT NOT NULL,
  model_id TEXT NOT NULL,
  body BLOB NOT NULL,
  weights BLOB,
  PRIMARY KEY(tenant, id),
  FOREIGN KEY(tenant, model_id) REFERENCES models(tenant, id)
    ON DELETE CASCADE);
CREATE INDEX bindings_of_model ON bindings(tenant, model_id);
CREATE TABLE sessions(
  number INTEGER PRIMARY KEY AUTOINCREMENT,
  tenant TEXT NOT NULL,
  id TEXT NOT NULL,
  binding_id TEXT NOT NULL,
  body BLOB NOT NULL,
  UNIQUE(tenant, id),
  FOREIGN KEY(tenant, binding_id) REFERENCES bindings(tenant, id)
    ON DELETE CASCADE);
CREATE INDEX sessions_of_binding ON sessions(tenant, binding_id);
CREATE TABLE poses(
  session INTEGER NOT NULL REFERENCES sessions(number) ON DELETE CASCADE,
  revision INTEGER NOT NULL,
  whole INTEGER NOT NULL,
  body BLOB NOT NULL,
  UNIQUE(session, revision));
)";

// To change the format: add what brings the last version to the next.
constexpr const char* kUpgrades[] = {kVersion1};

absl::Status Refused(absl::string_view reason, absl::string_view message) {
  return MakeError(absl::StatusCode::kFailedPrecondition, message,
                   {.reason = std::string(reason), .field = "data-dir"});
}

absl::Status CheckStructure(Database& database) {
  Statement check = database.Prepare("PRAGMA integrity_check(1)");
  DEFORM_ASSIGN_OR_RETURN(const bool row, check.Step());
  const std::string verdict = row ? check.Text(0) : "no answer";
  if (verdict == "ok") return absl::OkStatus();
  return MakeError(absl::StatusCode::kDataLoss,
                   absl::StrCat("the catalogue is damaged (", verdict,
                                "); restore it from a backup"),
                   {.reason = "CATALOGUE_DAMAGED", .field = "data-dir"});
}

}  // namespace

std::span<const char* const> StoreUpgrades() { return kUpgrades; }

absl::StatusOr<std::unique_ptr<StoreDatabase>> StoreDatabase::Open(
    const std::string& path, const char* vfs,
    std::span<const char* const> upgrades) {
  DEFORM_ASSIGN_OR_RETURN(auto database, Database::Open(path, vfs));
  std::unique_ptr<StoreDatabase> store(new StoreDatabase(std::move(database)));
  DEFORM_RETURN_IF_ERROR(store->Prepare(upgrades));
  return store;
}

absl::Status StoreDatabase::Prepare(std::span<const char* const> upgrades) {
  DEFORM_RETURN_IF_ERROR(CheckStructure(*database_));
  DEFORM_ASSIGN_OR_RETURN(const int64_t application,
                          database_->Number("PRAGMA application_id"));
  DEFORM_ASSIGN_OR_RETURN(const int64_t version,
                          database_->Number("PRAGMA user_version"));
  DEFORM_ASSIGN_OR_RETURN(
      const int64_t tables,
      database_->Number("SELECT count(*) FROM sqlite_schema"));
  const int64_t newest = static_cast<int64_t>(upgrades.size());
  if (application != kApplication && (application != 0 || tables > 0)) {
    return Refused("NOT_A_STORE", "the catalogue was not made by deformd");
  }
  if (version > newest) {
    return Refused("FORMAT_TOO_NEW",
                   absl::StrCat("the data directory has format ", version,
                                "; this version of deformd knows ", newest));
  }
  if (version == newest) return absl::OkStatus();
  const auto upgrade = [&]() -> absl::Status {
    for (int64_t step = version; step < newest; ++step) {
      DEFORM_RETURN_IF_ERROR(
          database_->Execute(upgrades[static_cast<size_t>(step)]));
    }
    return database_->Execute(
        absl::StrCat("PRAGMA application_id = ", kApplication,
                     "; PRAGMA user_version = ", newest));
  };
  return Atomically(upgrade);
}

}  // namespace deform::server
