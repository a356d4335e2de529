#include "server/stores/files.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform::server {
namespace {

constexpr int64_t kCopyBytes = int64_t{1} << 20;

// Calls again what a signal interrupted.
template <typename Call>
auto Uninterrupted(Call call) {
  auto result = call();
  while (result == -EINTR) result = call();
  return result;
}

template <typename Call>
absl::Status Do(absl::string_view action, const std::string& path, Call call) {
  const auto result = Uninterrupted(call);
  if (result >= 0) return absl::OkStatus();
  return FileError(static_cast<int>(-result), action, path);
}

}  // namespace

absl::Status FileError(int error, absl::string_view action,
                       const std::string& path) {
  absl::StatusCode code = absl::StatusCode::kUnavailable;
  std::string reason = "STORE_FAILED";
  if (error == ENOSPC || error == EDQUOT) {
    code = absl::StatusCode::kResourceExhausted;
    reason = "DISK_FULL";
  } else if (error == ENOENT) {
    code = absl::StatusCode::kNotFound;
    reason = "FILE_MISSING";
  } else if (error == EEXIST) {
    code = absl::StatusCode::kFailedPrecondition;
    reason = "DIRECTORY_EXISTS";
  }
  return MakeError(code,
                   absl::StrCat("cannot ", action, " ", path, ": ",
                                std::generic_category().message(error)),
                   {.reason = reason, .field = "data-dir"});
}

absl::Status FileDamaged(const std::string& path, absl::string_view how) {
  return MakeError(absl::StatusCode::kDataLoss,
                   absl::StrCat(path, " is damaged: ", how),
                   {.reason = "FILE_DAMAGED",
                    .resource_type = "file",
                    .resource_name = path});
}

absl::StatusOr<File> File::Open(FileSystem& files, const std::string& path,
                                FileSystem::Access access) {
  const int handle = Uninterrupted([&] { return files.Open(path, access); });
  if (handle < 0) return FileError(-handle, "open", path);
  return File(files, path, handle);
}

File::~File() {
  // What was written is durable by Sync(), not by closing.
  if (handle_ >= 0) files_->Close(handle_);
}

absl::StatusOr<int64_t> File::Size() const {
  const int64_t size = files_->Size(handle_);
  if (size < 0) return FileError(static_cast<int>(-size), "measure", path_);
  return size;
}

absl::Status File::ReadAt(int64_t offset, std::span<std::byte> out) const {
  while (!out.empty()) {
    const int64_t read = Uninterrupted([&] {
      return files_->ReadAt(handle_, out.data(), out.size(), offset);
    });
    if (read < 0) return FileError(static_cast<int>(-read), "read", path_);
    if (read == 0) return FileDamaged(path_, "it ends early");
    out = out.subspan(static_cast<size_t>(read));
    offset += read;
  }
  return absl::OkStatus();
}

absl::Status File::WriteAt(int64_t offset, std::span<const std::byte> data) {
  while (!data.empty()) {
    const int64_t written = Uninterrupted([&] {
      return files_->WriteAt(handle_, data.data(), data.size(), offset);
    });
    // POSIX lets a write of nothing happen only when nothing was asked for.
    if (written == 0) return FileError(EIO, "write", path_);
    if (written < 0) {
      return FileError(static_cast<int>(-written), "write", path_);
    }
    data = data.subspan(static_cast<size_t>(written));
    offset += written;
  }
  return absl::OkStatus();
}

absl::Status File::Sync() {
  return Do("sync", path_, [&] { return files_->Sync(handle_); });
}

absl::Status File::Truncate(int64_t size) {
  return Do("truncate", path_, [&] { return files_->Truncate(handle_, size); });
}

absl::StatusOr<std::shared_ptr<const std::byte>> File::Map(int64_t size) const {
  std::shared_ptr<const std::byte> mapping;
  DEFORM_RETURN_IF_ERROR(
      Do("map", path_, [&] { return files_->Map(handle_, size, mapping); }));
  return mapping;
}

absl::StatusOr<bool> File::Lock() {
  const int result = Uninterrupted([&] { return files_->Lock(handle_); });
  if (result == -EWOULDBLOCK) return false;
  if (result < 0) return FileError(-result, "lock", path_);
  return true;
}

absl::Status MakeDirectory(FileSystem& files, const std::string& path) {
  const int result = Uninterrupted([&] { return files.MakeDirectory(path); });
  if (result < 0 && result != -EEXIST) {
    return FileError(-result, "make folder", path);
  }
  return SyncFolder(files, FolderOf(path));
}

absl::Status MakeNewDirectory(FileSystem& files, const std::string& path) {
  DEFORM_RETURN_IF_ERROR(
      Do("make folder", path, [&] { return files.MakeDirectory(path); }));
  return SyncFolder(files, FolderOf(path));
}

absl::Status SyncFolder(FileSystem& files, const std::string& path) {
  return Do("sync", path, [&] { return files.SyncDirectory(path); });
}

absl::StatusOr<std::vector<std::string>> ListDirectory(
    FileSystem& files, const std::string& path) {
  std::vector<std::string> names;
  DEFORM_RETURN_IF_ERROR(Do("list", path, [&] {
    names.clear();
    return files.List(path, names);
  }));
  std::sort(names.begin(), names.end());
  return names;
}

absl::StatusOr<bool> Exists(FileSystem& files, const std::string& path) {
  const absl::StatusOr<File> file =
      File::Open(files, path, FileSystem::Access::kRead);
  if (absl::IsNotFound(file.status())) return false;
  if (!file.ok()) return file.status();
  return true;
}

absl::Status RenameFile(FileSystem& files, const std::string& from,
                        const std::string& to) {
  DEFORM_RETURN_IF_ERROR(
      Do("rename", from, [&] { return files.Rename(from, to); }));
  DEFORM_RETURN_IF_ERROR(SyncFolder(files, FolderOf(to)));
  if (FolderOf(from) == FolderOf(to)) return absl::OkStatus();
  return SyncFolder(files, FolderOf(from));
}

absl::Status RemoveFile(FileSystem& files, const std::string& path) {
  const int result = Uninterrupted([&] { return files.Unlink(path); });
  if (result < 0 && result != -ENOENT) {
    return FileError(-result, "remove", path);
  }
  return SyncFolder(files, FolderOf(path));
}

absl::Status CopyFile(FileSystem& files, const std::string& from,
                      const std::string& to) {
  DEFORM_ASSIGN_OR_RETURN(const File source,
                          File::Open(files, from, FileSystem::Access::kRead));
  DEFORM_ASSIGN_OR_RETURN(File target,
                          File::Open(files, to, FileSystem::Access::kCreate));
  DEFORM_ASSIGN_OR_RETURN(const int64_t size, source.Size());
  std::vector<std::byte> buffer(
      static_cast<size_t>(std::min(size, kCopyBytes)));
  for (int64_t offset = 0; offset < size; offset += kCopyBytes) {
    const std::span<std::byte> part(
        buffer.data(),
        static_cast<size_t>(std::min(size - offset, kCopyBytes)));
    DEFORM_RETURN_IF_ERROR(source.ReadAt(offset, part));
    DEFORM_RETURN_IF_ERROR(target.WriteAt(offset, part));
  }
  return target.Sync();
}

std::string FolderOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

}  // namespace deform::server
