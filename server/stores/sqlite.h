// SQLite with statuses: the only file, with its .cc, that knows sqlite3.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

struct sqlite3;
struct sqlite3_stmt;

namespace deform::server {

// One statement being run; ready to be run again when it goes.
class Statement {
 public:
  ~Statement();
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;

  // Parameters in order. Text and blobs are borrowed until the statement goes.
  Statement& Bind(int64_t number);
  Statement& Bind(uint64_t number) {
    return Bind(static_cast<int64_t>(number));
  }
  Statement& Bind(absl::string_view text);
  Statement& BindBlob(absl::string_view blob);

  // True: there is a row.
  absl::StatusOr<bool> Step();
  // For statements without rows.
  absl::Status Run();

  // Columns of the row, from 0; valid until the next Step().
  int64_t Int(int column) const;
  std::string Text(int column) const;
  std::span<const std::byte> Blob(int column) const;
  bool IsNull(int column) const;

 private:
  friend class Database;
  Statement(sqlite3* database, sqlite3_stmt* statement, absl::Status status)
      : database_(database),
        statement_(statement),
        status_(std::move(status)) {}
  void Check(int result);

  sqlite3* database_;
  sqlite3_stmt* statement_;
  absl::Status status_;
  int parameter_ = 0;
};

// Not thread-safe: one thread at a time.
//
// WAL with synchronous=FULL: a commit syncs the log, so that it survives a loss
// of power. The connection is exclusive: nobody else may open the file, which
// saves the shared memory between processes and most locking.
//
// Errors: ResourceExhausted DISK_FULL, DataLoss CATALOGUE_DAMAGED, else
// Unavailable STORE_FAILED.
class Database {
 public:
  // Made if it is not there. `vfs` may be null: the system's.
  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& path,
                                                        const char* vfs);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // Statements without parameters and rows.
  absl::Status Execute(const std::string& sql);
  // `sql` is a literal: it is compiled once. What goes wrong is told by the
  // first step.
  Statement Prepare(const char* sql);
  absl::StatusOr<int64_t> Number(const char* sql);
  int64_t changes() const;

  // Everything within either happens or does not.
  template <typename Body>
  absl::Status Atomically(Body body) {
    absl::Status status = Execute("BEGIN IMMEDIATE");
    if (status.ok()) status = body();
    if (status.ok()) status = Execute("COMMIT");
    if (!status.ok()) Rollback();
    return status;
  }

  // A copy into a new file, synced.
  absl::Status CopyTo(const std::string& path, const char* vfs);

 private:
  explicit Database(sqlite3* database) : database_(database) {}
  void Rollback();

  sqlite3* const database_;
  std::map<const char*, sqlite3_stmt*> prepared_;
};

}  // namespace deform::server
