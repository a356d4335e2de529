#include "server/stores/file_system.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace deform::server {
namespace {

template <typename Result>
Result OrError(Result result) {
  return result < 0 ? -errno : result;
}

class Posix : public FileSystem {
 public:
  int Open(const std::string& path, Access access) override {
    int flags = O_RDONLY;
    if (access == Access::kCreate) flags = O_RDWR | O_CREAT | O_EXCL;
    if (access == Access::kShare) flags = O_RDWR | O_CREAT;
    return OrError(open(path.c_str(), flags | O_CLOEXEC, 0600));
  }
  int Close(int file) override { return OrError(close(file)); }
  int64_t Size(int file) override {
    struct stat status;
    return fstat(file, &status) < 0 ? -errno : status.st_size;
  }
  int64_t ReadAt(int file, void* out, size_t size, int64_t offset) override {
    return OrError<int64_t>(pread(file, out, size, offset));
  }
  int64_t WriteAt(int file, const void* data, size_t size,
                  int64_t offset) override {
    return OrError<int64_t>(pwrite(file, data, size, offset));
  }
  int Truncate(int file, int64_t size) override {
    return OrError(ftruncate(file, size));
  }
  int Sync(int file) override { return OrError(fsync(file)); }
  int Lock(int file) override {
    return OrError(flock(file, LOCK_EX | LOCK_NB));
  }
  int Map(int file, int64_t size,
          std::shared_ptr<const std::byte>& out) override {
    const size_t length = static_cast<size_t>(size);
    void* address = mmap(nullptr, length, PROT_READ, MAP_SHARED, file, 0);
    if (address == MAP_FAILED) return -errno;
    out = std::shared_ptr<const std::byte>(
        static_cast<const std::byte*>(address),
        [length](const std::byte* begin) {
          munmap(const_cast<std::byte*>(begin), length);
        });
    return 0;
  }
  int Rename(const std::string& from, const std::string& to) override {
    return OrError(rename(from.c_str(), to.c_str()));
  }
  int Link(const std::string& from, const std::string& to) override {
    return OrError(link(from.c_str(), to.c_str()));
  }
  int Unlink(const std::string& path) override {
    return OrError(unlink(path.c_str()));
  }
  int MakeDirectory(const std::string& path) override {
    return OrError(mkdir(path.c_str(), 0700));
  }
  int List(const std::string& directory,
           std::vector<std::string>& names) override {
    DIR* stream = opendir(directory.c_str());
    if (stream == nullptr) return -errno;
    errno = 0;
    while (const dirent* entry = readdir(stream)) {
      const std::string name = entry->d_name;
      if (name != "." && name != "..") names.push_back(name);
    }
    const int error = errno;
    closedir(stream);
    return -error;
  }
  int SyncDirectory(const std::string& directory) override {
    const int file =
        OrError(open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (file < 0) return file;
    const int result = OrError(fsync(file));
    close(file);
    return result;
  }
};

}  // namespace

FileSystem& PosixFileSystem() {
  static Posix files;
  return files;
}

}  // namespace deform::server
