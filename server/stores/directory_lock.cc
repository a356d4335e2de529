#include "server/stores/directory_lock.h"

#include <unistd.h>

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/bytes.h"

namespace deform::server {
namespace {

constexpr int64_t kMaxPidBytes = 20;

// Who has the lock has written its number.
std::string ReadPid(const File& file) {
  const int64_t size = std::min(file.Size().value_or(0), kMaxPidBytes);
  std::string pid(static_cast<size_t>(size), ' ');
  const absl::Status read =
      file.ReadAt(0, {reinterpret_cast<std::byte*>(pid.data()), pid.size()});
  return read.ok() && !pid.empty() ? pid : "unknown";
}

}  // namespace

absl::StatusOr<DirectoryLock> DirectoryLock::Take(
    FileSystem& files, const std::string& directory) {
  DEFORM_ASSIGN_OR_RETURN(File file,
                          File::Open(files, absl::StrCat(directory, "/lock"),
                                     FileSystem::Access::kShare));
  DEFORM_ASSIGN_OR_RETURN(const bool locked, file.Lock());
  if (!locked) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     absl::StrCat("the data directory ", directory,
                                  " is used by process ", ReadPid(file)),
                     {.reason = "DIRECTORY_IN_USE", .field = "data-dir"});
  }
  DEFORM_RETURN_IF_ERROR(file.Truncate(0));
  DEFORM_RETURN_IF_ERROR(file.WriteAt(0, AsBytes(absl::StrCat(getpid()))));
  return DirectoryLock(std::move(file));
}

}  // namespace deform::server
