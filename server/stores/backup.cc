#include "server/stores/backup.h"

#include <cerrno>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/array_file.h"
#include "server/stores/array_shelf.h"
#include "server/stores/files.h"
#include "server/stores/store_database.h"

namespace deform::server {
namespace {

absl::Status CheckNew(FileSystem& files, const std::string& directory) {
  std::vector<std::string> ignored;
  const int found = files.List(directory, ignored);
  if (found == -ENOENT) return absl::OkStatus();
  return FileError(found < 0 ? -found : EEXIST, "make", directory);
}

// For a copy that is not complete yet.
absl::Status MakePartial(FileSystem& files, const std::string& partial) {
  std::vector<std::string> ignored;
  if (files.List(partial, ignored) >= 0) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition,
        absl::StrCat(partial,
                     " is there, left of a copy that failed or runs "
                     "elsewhere: remove it if none does"),
        {.reason = "DIRECTORY_EXISTS"});
  }
  return MakeNewDirectory(files, partial);
}

// The folders of `name` below `directory`.
absl::Status MakeFoldersOf(FileSystem& files, const std::string& directory,
                           const std::string& name) {
  for (size_t slash = name.find('/'); slash != std::string::npos;
       slash = name.find('/', slash + 1)) {
    DEFORM_RETURN_IF_ERROR(MakeDirectory(
        files, absl::StrCat(directory, "/", name.substr(0, slash))));
  }
  return absl::OkStatus();
}

}  // namespace

std::string CatalogueFile(const std::string& directory) {
  return absl::StrCat(directory, "/catalogue.sqlite");
}

absl::Status BackupWriter::Begin() {
  DEFORM_RETURN_IF_ERROR(CheckNew(files_, target_));
  DEFORM_RETURN_IF_ERROR(MakeDirectory(files_, FolderOf(target_)));
  return MakePartial(files_, partial());
}

absl::Status BackupWriter::Finish(const std::vector<std::string>& arrays) {
  for (const std::string& name : arrays) {
    DEFORM_RETURN_IF_ERROR(Add(name));
  }
  DEFORM_RETURN_IF_ERROR(SyncFolder(files_, partial()));
  return RenameFile(files_, partial(), target_);
}

absl::Status BackupWriter::Add(const std::string& name) {
  DEFORM_RETURN_IF_ERROR(MakeFoldersOf(files_, partial(), name));
  const std::string from = absl::StrCat(source_, "/", name);
  const std::string to = absl::StrCat(partial(), "/", name);
  const int linked = files_.Link(from, to);
  if (linked == -ENOENT) return absl::OkStatus();
  // Another disk, or one that knows no links.
  if (linked < 0) DEFORM_RETURN_IF_ERROR(CopyFile(files_, from, to));
  return SyncFolder(files_, FolderOf(to));
}

absl::StatusOr<std::vector<std::string>> RestoreBackup(
    FileSystem& files, const char* vfs, const std::string& backup,
    const std::string& directory) {
  std::vector<std::string> left_out;
  DEFORM_RETURN_IF_ERROR(CheckNew(files, directory));
  const std::string partial = absl::StrCat(directory, ".partial");
  DEFORM_RETURN_IF_ERROR(MakePartial(files, partial));
  DEFORM_RETURN_IF_ERROR(
      CopyFile(files, CatalogueFile(backup), CatalogueFile(partial)));
  {
    DEFORM_ASSIGN_OR_RETURN(const auto database,
                            StoreDatabase::Open(CatalogueFile(partial), vfs));
    DEFORM_ASSIGN_OR_RETURN(const auto names, database->Files());
    for (const std::string& name : names) {
      const std::string from = absl::StrCat(backup, "/", name);
      const std::string to = absl::StrCat(partial, "/", name);
      DEFORM_ASSIGN_OR_RETURN(const bool there, Exists(files, from));
      if (!there) continue;  // Neither did the store have it.
      const absl::Status sound = ReadArrayFile(files, from, name).status();
      if (IsWeightsFile(name) && DetailOf(sound).reason == "FILE_DAMAGED") {
        left_out.push_back(from);
        continue;
      }
      DEFORM_RETURN_IF_ERROR(sound);
      DEFORM_RETURN_IF_ERROR(MakeFoldersOf(files, partial, name));
      DEFORM_RETURN_IF_ERROR(CopyFile(files, from, to));
      DEFORM_RETURN_IF_ERROR(SyncFolder(files, FolderOf(to)));
    }
  }
  DEFORM_RETURN_IF_ERROR(SyncFolder(files, partial));
  DEFORM_RETURN_IF_ERROR(RenameFile(files, partial, directory));
  return left_out;
}

}  // namespace deform::server
