// The backups that clients have asked for.
#pragma once

#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "core/base/mutex.h"
#include "server/stores/store.h"

namespace deform::server {

// Thread-safe.
class BackupFolder {
 public:
  // Holds no more than `limit`. `store` and `files` are borrowed.
  BackupFolder(Store& store, FileSystem& files, std::string path, int64_t limit)
      : store_(store), files_(files), path_(std::move(path)), limit_(limit) {}

  // Makes one, in a folder of that name, and returns where. One at a time.
  // As Store::Backup(), and ResourceExhausted TOO_MANY_BACKUPS.
  absl::StatusOr<std::string> Make(const std::string& name);

 private:
  Store& store_;
  FileSystem& files_;
  const std::string path_;
  const int64_t limit_;
  Mutex mutex_;
};

}  // namespace deform::server
