// Copies of a data directory, made while it is in use, and back.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/stores/file_system.h"

namespace deform::server {

// "<directory>/catalogue.sqlite".
std::string CatalogueFile(const std::string& directory);

// What Store::Backup() does with files. They are linked where that can be done,
// since they never change, else copied; a link costs nothing, but shares the
// fate of the disk. Until Finish() the copy is called <target>.partial.
class BackupWriter {
 public:
  // `files` is borrowed.
  BackupWriter(FileSystem& files, std::string source, std::string target)
      : files_(files), source_(std::move(source)), target_(std::move(target)) {}

  // FailedPrecondition DIRECTORY_EXISTS.
  absl::Status Begin();
  // Where the catalogue is to be copied to, in between.
  std::string catalogue() const { return CatalogueFile(partial()); }
  // With the arrays of these names. One that is gone from the source was put
  // into quarantine, and is gone from the copy.
  absl::Status Finish(const std::vector<std::string>& arrays);

 private:
  std::string partial() const { return target_ + ".partial"; }
  absl::Status Add(const std::string& name);

  FileSystem& files_;
  const std::string source_;
  const std::string target_;
};

// Makes the data directory `directory`, which must not exist, from a backup.
// Every array is verified first, so that nothing damaged comes back. Damaged
// weights are left out, since they can be computed again: returns their files.
// Else DataLoss FILE_DAMAGED, CATALOGUE_DAMAGED; FailedPrecondition
// DIRECTORY_EXISTS, DIRECTORY_IN_USE, FORMAT_TOO_NEW. `vfs` as in StoreOptions.
absl::StatusOr<std::vector<std::string>> RestoreBackup(
    FileSystem& files, const char* vfs, const std::string& backup,
    const std::string& directory);

}  // namespace deform::server
