// A disk in memory that fails on request and forgets what was not synced.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "core/base/mutex.h"
#include "server/stores/file_system.h"

struct sqlite3_vfs;

namespace deform::server {

// As far as POSIX promises: data of a file is durable once the file is synced,
// a name once its folder is. When power goes, of everything else any part may
// have reached the disk, in any order, writes in sectors of 512 bytes.
//
// SQLite sees the same disk by a VFS of its own. Thread-safe.
class SimulatedDisk : public FileSystem {
 public:
  SimulatedDisk();
  ~SimulatedDisk() override;

  // What happens at the `at`-th call from now, counting from 0.
  struct Fault {
    enum class Kind {
      kError,      // It fails.
      kShort,      // Reads and writes do half of what was asked for.
      kTorn,       // A write does half of it and fails; others fail.
      kPowerLoss,  // It fails, and so does everything after it.
    };
    Kind kind = Kind::kError;
    int64_t at = 0;
    int error = 0;
  };
  void Inject(const Fault& fault);
  // Whether it has happened.
  bool Struck() const;
  int64_t calls() const;

  // The process dies: files are closed, and what was written is there.
  void EndProcess();
  // Power comes back after a loss; what is left depends on `seed`.
  void Restart(uint64_t seed);

  // Files together may have so many bytes from now on; writes beyond fail with
  // ENOSPC.
  void SetSize(int64_t bytes);
  // That they have.
  int64_t Used() const;

  // From now on it says that it synced these, and does not.
  enum class Lie { kNone, kFiles, kNames };
  void LieAboutSyncsOf(Lie lie);

  // For StoreOptions::sqlite_vfs.
  const char* vfs() const { return vfs_name_.c_str(); }
  // Without faults, for tests that look and damage.
  std::string Contents(const std::string& path) const;
  void Replace(const std::string& path, const std::string& contents);
  std::vector<std::string> Files() const;

  int Open(const std::string& path, Access access) override;
  int Close(int file) override;
  int64_t Size(int file) override;
  int64_t ReadAt(int file, void* out, size_t size, int64_t offset) override;
  int64_t WriteAt(int file, const void* data, size_t size,
                  int64_t offset) override;
  int Truncate(int file, int64_t size) override;
  int Sync(int file) override;
  int Lock(int file) override;
  int Map(int file, int64_t size,
          std::shared_ptr<const std::byte>& out) override;
  int Rename(const std::string& from, const std::string& to) override;
  int Link(const std::string& from, const std::string& to) override;
  int Unlink(const std::string& path) override;
  int MakeDirectory(const std::string& path) override;
  int List(const std::string& directory,
           std::vector<std::string>& names) override;
  int SyncDirectory(const std::string& directory) override;

 private:
  struct Write {
    int64_t offset = 0;  // -1: not a write, but the end of the file at `size`.
    int64_t size = 0;
    std::string data;
  };
  struct Node {
    bool folder = false;
    std::string now;
    std::string durable;
    std::vector<Write> pending;
    int locked_by = 0;
  };
  using Names = std::map<std::string, std::shared_ptr<Node>>;
  // A rename takes one name away and gives another.
  struct NameChange {
    std::string gone;
    std::string made;
    std::shared_ptr<Node> node;
  };

  // 0, or the error that the call returns; counts it.
  int Enter() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int64_t UsedBytes() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::shared_ptr<Node> Find(int file) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Change(NameChange change) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static void Apply(const NameChange& change, Names& names);
  static void Apply(const Write& write, std::string& contents);
  void CloseAll() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string vfs_name_;
  const std::unique_ptr<sqlite3_vfs> vfs_;
  mutable Mutex mutex_;
  Names names_ ABSL_GUARDED_BY(mutex_);
  Names durable_names_ ABSL_GUARDED_BY(mutex_);
  std::vector<NameChange> pending_ ABSL_GUARDED_BY(mutex_);
  std::map<int, std::shared_ptr<Node>> open_ ABSL_GUARDED_BY(mutex_);
  int next_file_ ABSL_GUARDED_BY(mutex_) = 1;
  int64_t calls_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<Fault> fault_ ABSL_GUARDED_BY(mutex_);
  // Set for the one call that a short or torn fault strikes.
  std::optional<Fault> striking_ ABSL_GUARDED_BY(mutex_);
  bool powered_ ABSL_GUARDED_BY(mutex_) = true;
  int64_t size_ ABSL_GUARDED_BY(mutex_) = INT64_MAX;
  Lie lie_ ABSL_GUARDED_BY(mutex_) = Lie::kNone;
};

// A VFS that keeps its files on `disk`, to be registered under `name`.
std::unique_ptr<sqlite3_vfs> MakeSimulatedVfs(SimulatedDisk& disk,
                                              const char* name);

}  // namespace deform::server
