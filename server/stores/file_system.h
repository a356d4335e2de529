// The calls to the operating system that stores make, so that tests can refuse
// them, cut them short and pull the plug between any two.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace deform::server {

// Thread-safe. Returns what POSIX does, with -errno in place of -1.
class FileSystem {
 public:
  enum class Access {
    kRead,
    kCreate,  // To write; there must be none.
    kShare,   // To read and write; made if there is none.
  };

  virtual ~FileSystem() = default;

  virtual int Open(const std::string& path, Access access) = 0;
  virtual int Close(int file) = 0;
  virtual int64_t Size(int file) = 0;
  // These may do less than was asked for.
  virtual int64_t ReadAt(int file, void* out, size_t size, int64_t offset) = 0;
  virtual int64_t WriteAt(int file, const void* data, size_t size,
                          int64_t offset) = 0;
  virtual int Truncate(int file, int64_t size) = 0;
  virtual int Sync(int file) = 0;
  // -EWOULDBLOCK if another has it. Held until the file is closed or the
  // process ends.
  virtual int Lock(int file) = 0;
  // The whole file, read-only; it stays while `out` does.
  virtual int Map(int file, int64_t size,
                  std::shared_ptr<const std::byte>& out) = 0;

  // Replaces what is called `to`.
  virtual int Rename(const std::string& from, const std::string& to) = 0;
  virtual int Link(const std::string& from, const std::string& to) = 0;
  virtual int Unlink(const std::string& path) = 0;
  virtual int MakeDirectory(const std::string& path) = 0;
  // Without "." and "..", in no order.
  virtual int List(const std::string& directory,
                   std::vector<std::string>& names) = 0;
  // Makes what was renamed, linked, made and unlinked in it durable.
  virtual int SyncDirectory(const std::string& directory) = 0;
};

FileSystem& PosixFileSystem();

}  // namespace deform::server
