#include "server/stores/sqlite.h"

#include <sqlite3.h>

#include <cerrno>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {
namespace {

// What the system said. SQLite keeps it for some calls only; of the others the
// last error of the VFS is the one that made them fail.
int SystemError(sqlite3* database) {
  const int kept = sqlite3_system_errno(database);
  if (kept != 0) return kept;
  sqlite3_vfs* vfs = nullptr;
  sqlite3_file_control(database, "main", SQLITE_FCNTL_VFS_POINTER, &vfs);
  if (vfs == nullptr || vfs->xGetLastError == nullptr) return 0;
  return vfs->xGetLastError(vfs, 0, nullptr);
}

absl::Status SqliteError(sqlite3* database, int result) {
  absl::StatusCode code = absl::StatusCode::kUnavailable;
  std::string reason = "STORE_FAILED";
  const int primary = result & 0xff;
  const int system = primary == SQLITE_IOERR || primary == SQLITE_CANTOPEN
                         ? SystemError(database)
                         : 0;
  if (primary == SQLITE_FULL || system == ENOSPC || system == EDQUOT) {
    code = absl::StatusCode::kResourceExhausted;
    reason = "DISK_FULL";
  } else if (primary == SQLITE_CORRUPT || primary == SQLITE_NOTADB ||
             result == SQLITE_IOERR_SHORT_READ) {
    code = absl::StatusCode::kDataLoss;
    reason = "CATALOGUE_DAMAGED";
  }
  return MakeError(code,
                   absl::StrCat("the catalogue: ", sqlite3_errmsg(database),
                                " (SQLite ", result, ", errno ", system, ")"),
                   {.reason = reason, .field = "data-dir"});
}

constexpr char kSettings[] =
    "PRAGMA locking_mode=EXCLUSIVE;"
    "PRAGMA journal_mode=WAL;"
    "PRAGMA synchronous=FULL;"
    "PRAGMA foreign_keys=ON;"
    "PRAGMA temp_store=MEMORY;"
    // Damaged pages are found sooner.
    "PRAGMA cell_size_check=ON;"
    // A log that grew during a long backup does not stay so long.
    "PRAGMA journal_size_limit=16777216;";

}  // namespace

Statement::Statement(Statement&& other) noexcept
    : database_(other.database_),
      statement_(std::exchange(other.statement_, nullptr)),
      status_(std::move(other.status_)),
      parameter_(other.parameter_) {}

Statement::~Statement() {
  if (statement_ == nullptr) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

void Statement::Check(int result) {
  if (status_.ok() && result != SQLITE_OK) {
    status_ = SqliteError(database_, result);
  }
}

Statement& Statement::Bind(int64_t number) {
  Check(sqlite3_bind_int64(statement_, ++parameter_, number));
  return *this;
}

Statement& Statement::Bind(absl::string_view text) {
  Check(sqlite3_bind_text64(statement_, ++parameter_, text.data(), text.size(),
                            SQLITE_STATIC, SQLITE_UTF8));
  return *this;
}

Statement& Statement::BindBlob(absl::string_view blob) {
  Check(sqlite3_bind_blob64(statement_, ++parameter_, blob.data(), blob.size(),
                            SQLITE_STATIC));
  return *this;
}

absl::StatusOr<bool> Statement::Step() {
  if (!status_.ok()) return status_;
  const int result = sqlite3_step(statement_);
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  return SqliteError(database_, result);
}

absl::Status Statement::Run() { return Step().status(); }

int64_t Statement::Int(int column) const {
  return sqlite3_column_int64(statement_, column);
}

std::string Statement::Text(int column) const {
  const auto bytes = Blob(column);
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

std::span<const std::byte> Statement::Blob(int column) const {
  const void* data = sqlite3_column_blob(statement_, column);
  const int size = sqlite3_column_bytes(statement_, column);
  return {static_cast<const std::byte*>(data), static_cast<size_t>(size)};
}

bool Statement::IsNull(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}

absl::StatusOr<std::unique_ptr<Database>> Database::Open(
    const std::string& path, const char* vfs) {
  sqlite3* handle = nullptr;
  const int result = sqlite3_open_v2(
      path.c_str(), &handle,
      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, vfs);
  std::unique_ptr<Database> database(new Database(handle));
  if (result != SQLITE_OK) return SqliteError(handle, result);
  sqlite3_extended_result_codes(handle, 1);
  DEFORM_RETURN_IF_ERROR(database->Execute(kSettings));
  return database;
}

Database::~Database() {
  for (const auto& [sql, statement] : prepared_) sqlite3_finalize(statement);
  sqlite3_close(database_);
}

absl::Status Database::Execute(const std::string& sql) {
  const int result =
      sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr);
  if (result != SQLITE_OK) return SqliteError(database_, result);
  return absl::OkStatus();
}

Statement Database::Prepare(const char* sql) {
  sqlite3_stmt*& statement = prepared_[sql];
  if (statement == nullptr) {
    const int result = sqlite3_prepare_v3(
        database_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
    if (result != SQLITE_OK) {
      return Statement(database_, nullptr, SqliteError(database_, result));
    }
  }
  return Statement(database_, statement, absl::OkStatus());
}

absl::StatusOr<int64_t> Database::Number(const char* sql) {
  Statement statement = Prepare(sql);
  DEFORM_ASSIGN_OR_RETURN(const bool row, statement.Step());
  return row ? statement.Int(0) : 0;
}

int64_t Database::changes() const { return sqlite3_changes64(database_); }

void Database::Rollback() {
  // Some errors have rolled back already.
  if (sqlite3_get_autocommit(database_) == 0) {
    Execute("ROLLBACK").IgnoreError();
  }
}

absl::Status Database::CopyTo(const std::string& path, const char* vfs) {
  sqlite3* target = nullptr;
  int result = sqlite3_open_v2(
      path.c_str(), &target,
      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, vfs);
  const std::unique_ptr<sqlite3, int (*)(sqlite3*)> closer(target,
                                                           &sqlite3_close);
  if (result != SQLITE_OK) return SqliteError(target, result);
  sqlite3_extended_result_codes(target, 1);
  sqlite3_backup* backup =
      sqlite3_backup_init(target, "main", database_, "main");
  if (backup == nullptr) return SqliteError(target, sqlite3_errcode(target));
  result = sqlite3_backup_step(backup, -1);
  const int finished = sqlite3_backup_finish(backup);
  if (finished != SQLITE_OK) return SqliteError(target, finished);
  if (result != SQLITE_DONE) return SqliteError(target, result);
  return absl::OkStatus();
}

}  // namespace deform::server
