// One process a data directory.
#pragma once

#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "server/stores/file_system.h"
#include "server/stores/files.h"

namespace deform::server {

// The kernel lets go when the process ends, however it does.
class DirectoryLock {
 public:
  // FailedPrecondition DIRECTORY_IN_USE, which names the process.
  static absl::StatusOr<DirectoryLock> Take(FileSystem& files,
                                            const std::string& directory);

 private:
  explicit DirectoryLock(File file) : file_(std::move(file)) {}
  File file_;
};

}  // namespace deform::server
