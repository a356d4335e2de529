// SQLite on a simulated disk: what its own VFS for POSIX does, without sharing
// between processes.
#include <sqlite3.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <string>

#include "server/stores/files.h"
#include "tests/server/stores/simulated_disk.h"

namespace deform::server {
namespace {

struct OpenFile {
  sqlite3_file base;
  SimulatedDisk* disk;
  int handle;
  // Not yet synced: its name is to be synced with it, as unixSync() does for
  // journals and logs.
  std::string* unsynced_name;
};

OpenFile& FileOf(sqlite3_file* file) {
  return *reinterpret_cast<OpenFile*>(file);
}
SimulatedDisk& DiskOf(sqlite3_vfs* vfs) {
  return *static_cast<SimulatedDisk*>(vfs->pAppData);
}

thread_local int last_error = 0;

// `result`, with a failure noted for xGetLastError.
template <typename Call>
auto Noted(Call call) {
  auto result = call();
  while (result == -EINTR) result = call();
  if (result < 0) last_error = static_cast<int>(-result);
  return result;
}

int Close(sqlite3_file* base) {
  OpenFile& file = FileOf(base);
  const int result = Noted([&] { return file.disk->Close(file.handle); });
  delete file.unsynced_name;
  return result < 0 ? SQLITE_IOERR_CLOSE : SQLITE_OK;
}

int Read(sqlite3_file* base, void* out, int size, sqlite3_int64 offset) {
  OpenFile& file = FileOf(base);
  char* bytes = static_cast<char*>(out);
  int64_t done = 0;
  while (done < size) {
    const int64_t read = Noted([&] {
      return file.disk->ReadAt(file.handle, bytes + done,
                               static_cast<size_t>(size - done), offset + done);
    });
    if (read < 0) return SQLITE_IOERR_READ;
    if (read == 0) break;
    done += read;
  }
  if (done == size) return SQLITE_OK;
  std::memset(bytes + done, 0, static_cast<size_t>(size - done));
  return SQLITE_IOERR_SHORT_READ;
}

int Write(sqlite3_file* base, const void* data, int size,
          sqlite3_int64 offset) {
  OpenFile& file = FileOf(base);
  const char* bytes = static_cast<const char*>(data);
  int64_t done = 0;
  while (done < size) {
    const int64_t written = Noted([&] {
      return file.disk->WriteAt(file.handle, bytes + done,
                                static_cast<size_t>(size - done),
                                offset + done);
    });
    if (written == -ENOSPC) return SQLITE_FULL;
    if (written <= 0) return SQLITE_IOERR_WRITE;
    done += written;
  }
  return SQLITE_OK;
}

int Truncate(sqlite3_file* base, sqlite3_int64 size) {
  OpenFile& file = FileOf(base);
  const int result =
      Noted([&] { return file.disk->Truncate(file.handle, size); });
  return result < 0 ? SQLITE_IOERR_TRUNCATE : SQLITE_OK;
}

int Sync(sqlite3_file* base, int /*flags*/) {
  OpenFile& file = FileOf(base);
  if (Noted([&] { return file.disk->Sync(file.handle); }) < 0) {
    return SQLITE_IOERR_FSYNC;
  }
  if (file.unsynced_name == nullptr) return SQLITE_OK;
  const int result = Noted(
      [&] { return file.disk->SyncDirectory(FolderOf(*file.unsynced_name)); });
  if (result < 0) return SQLITE_IOERR_DIR_FSYNC;
  delete file.unsynced_name;
  file.unsynced_name = nullptr;
  return SQLITE_OK;
}

int FileSize(sqlite3_file* base, sqlite3_int64* size) {
  OpenFile& file = FileOf(base);
  *size = Noted([&] { return file.disk->Size(file.handle); });
  return *size < 0 ? SQLITE_IOERR_FSTAT : SQLITE_OK;
}

// There is one connection.
int Lock(sqlite3_file* /*file*/, int /*level*/) { return SQLITE_OK; }
int CheckReserved(sqlite3_file* /*file*/, int* reserved) {
  *reserved = 0;
  return SQLITE_OK;
}
int Control(sqlite3_file* /*file*/, int /*what*/, void* /*argument*/) {
  return SQLITE_NOTFOUND;
}
int SectorSize(sqlite3_file* /*file*/) { return 4096; }
int Characteristics(sqlite3_file* /*file*/) {
  return SQLITE_IOCAP_POWERSAFE_OVERWRITE;
}

// Version 1: no memory shared between processes, which an exclusive connection
// does not need.
constexpr sqlite3_io_methods kMethods = {
    1,    Close, Read,          Write,   Truncate,   Sync,           FileSize,
    Lock, Lock,  CheckReserved, Control, SectorSize, Characteristics};

int Open(sqlite3_vfs* vfs, const char* path, sqlite3_file* base, int flags,
         int* out_flags) {
  OpenFile& file = FileOf(base);
  file.base.pMethods = nullptr;
  SimulatedDisk& disk = DiskOf(vfs);
  const auto access = (flags & SQLITE_OPEN_CREATE) != 0
                          ? FileSystem::Access::kShare
                          : FileSystem::Access::kRead;
  const int handle = Noted([&] { return disk.Open(path, access); });
  if (handle < 0) return SQLITE_CANTOPEN;
  const bool log = (flags & (SQLITE_OPEN_WAL | SQLITE_OPEN_MAIN_JOURNAL)) != 0;
  file = {{&kMethods}, &disk, handle, log ? new std::string(path) : nullptr};
  if (out_flags != nullptr) *out_flags = flags;
  return SQLITE_OK;
}

int Delete(sqlite3_vfs* vfs, const char* path, int sync_folder) {
  SimulatedDisk& disk = DiskOf(vfs);
  const int result = Noted([&] { return disk.Unlink(path); });
  if (result == -ENOENT) return SQLITE_IOERR_DELETE_NOENT;
  if (result < 0) return SQLITE_IOERR_DELETE;
  if (sync_folder == 0) return SQLITE_OK;
  const int synced = Noted([&] { return disk.SyncDirectory(FolderOf(path)); });
  return synced < 0 ? SQLITE_IOERR_DIR_FSYNC : SQLITE_OK;
}

int Access(sqlite3_vfs* vfs, const char* path, int /*flags*/, int* found) {
  SimulatedDisk& disk = DiskOf(vfs);
  const int file =
      Noted([&] { return disk.Open(path, FileSystem::Access::kRead); });
  *found = file >= 0;
  if (file >= 0) disk.Close(file);
  return file < 0 && file != -ENOENT ? SQLITE_IOERR_ACCESS : SQLITE_OK;
}

int FullPathname(sqlite3_vfs* /*vfs*/, const char* path, int size, char* out) {
  sqlite3_snprintf(size, out, "%s", path);
  return SQLITE_OK;
}

sqlite3_vfs& System() { return *sqlite3_vfs_find(nullptr); }
int Randomness(sqlite3_vfs* /*vfs*/, int size, char* out) {
  return System().xRandomness(&System(), size, out);
}
int Sleep(sqlite3_vfs* /*vfs*/, int /*microseconds*/) { return 0; }
int CurrentTime(sqlite3_vfs* /*vfs*/, double* now) {
  return System().xCurrentTime(&System(), now);
}
int LastError(sqlite3_vfs* /*vfs*/, int /*size*/, char* /*out*/) {
  return last_error;
}

}  // namespace

std::unique_ptr<sqlite3_vfs> MakeSimulatedVfs(SimulatedDisk& disk,
                                              const char* name) {
  auto vfs = std::make_unique<sqlite3_vfs>();
  std::memset(vfs.get(), 0, sizeof(sqlite3_vfs));
  vfs->iVersion = 1;
  vfs->szOsFile = sizeof(OpenFile);
  vfs->mxPathname = 512;
  vfs->zName = name;
  vfs->pAppData = &disk;
  vfs->xOpen = Open;
  vfs->xDelete = Delete;
  vfs->xAccess = Access;
  vfs->xFullPathname = FullPathname;
  vfs->xRandomness = Randomness;
  vfs->xSleep = Sleep;
  vfs->xCurrentTime = CurrentTime;
  vfs->xGetLastError = LastError;
  return vfs;
}

}  // namespace deform::server
