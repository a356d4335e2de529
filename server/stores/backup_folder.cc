#include "server/stores/backup_folder.h"

#include <cerrno>
#include <cstddef>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/files.h"

namespace deform::server {

absl::StatusOr<std::string> BackupFolder::Make(const std::string& name) {
  MutexLock lock(mutex_);
  // What a crash has left of one counts, too: nobody removes it but by hand.
  std::vector<std::string> there;
  const int listed = files_.List(path_, there);
  if (listed < 0 && listed != -ENOENT) {
    return FileError(-listed, "list", path_);
  }
  if (static_cast<int64_t>(there.size()) >= limit_) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat(path_, " holds ", there.size(),
                     " backups, its limit (max-backups): move some elsewhere"),
        {.reason = "TOO_MANY_BACKUPS", .field = "max-backups"});
  }
  std::string directory = absl::StrCat(path_, "/", name);
  DEFORM_RETURN_IF_ERROR(store_.Backup(directory));
  return directory;
}

}  // namespace deform::server
