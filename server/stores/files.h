// Files and folders with errors as statuses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "server/stores/file_system.h"

namespace deform::server {

// What an errno is to the callers of a store: ResourceExhausted DISK_FULL,
// NotFound FILE_MISSING, FailedPrecondition DIRECTORY_EXISTS, else Unavailable
// STORE_FAILED. "cannot <do> <path>: <why>".
absl::Status FileError(int error, absl::string_view action,
                       const std::string& path);

// DataLoss FILE_DAMAGED: "<path> is damaged: <how>".
absl::Status FileDamaged(const std::string& path, absl::string_view how);

// An open file; closed when it goes. Not thread-safe.
class File {
 public:
  static absl::StatusOr<File> Open(FileSystem& files, const std::string& path,
                                   FileSystem::Access access);
  File(File&& other) noexcept
      : files_(other.files_),
        path_(std::move(other.path_)),
        handle_(std::exchange(other.handle_, -1)) {}
  File& operator=(File&&) = delete;
  ~File();

  const std::string& path() const { return path_; }

  absl::StatusOr<int64_t> Size() const;
  // All of `out`; DataLoss FILE_DAMAGED if the file ends before.
  absl::Status ReadAt(int64_t offset, std::span<std::byte> out) const;
  absl::Status WriteAt(int64_t offset, std::span<const std::byte> data);
  absl::Status Sync();
  absl::StatusOr<std::shared_ptr<const std::byte>> Map(int64_t size) const;
  // False if another has the lock.
  absl::StatusOr<bool> Lock();
  absl::Status Truncate(int64_t size);

 private:
  File(FileSystem& files, std::string path, int handle)
      : files_(&files), path_(std::move(path)), handle_(handle) {}

  FileSystem* files_;
  std::string path_;
  int handle_;
};

// There must be none: FailedPrecondition DIRECTORY_EXISTS.
absl::Status MakeNewDirectory(FileSystem& files, const std::string& path);
// Durable when it returns, also if it was there before.
absl::Status MakeDirectory(FileSystem& files, const std::string& path);
absl::Status SyncFolder(FileSystem& files, const std::string& path);
absl::StatusOr<std::vector<std::string>> ListDirectory(FileSystem& files,
                                                       const std::string& path);
absl::StatusOr<bool> Exists(FileSystem& files, const std::string& path);
// Durable when they return. A file that is not there is removed.
absl::Status RenameFile(FileSystem& files, const std::string& from,
                        const std::string& to);
absl::Status RemoveFile(FileSystem& files, const std::string& path);
// Synced itself, but not its name.
absl::Status CopyFile(FileSystem& files, const std::string& from,
                      const std::string& to);

// "/a" of "/a/b".
std::string FolderOf(const std::string& path);

}  // namespace deform::server
