#include "tests/server/stores/simulated_disk.h"

#include <sqlite3.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/stores/files.h"

namespace deform::server {
namespace {

constexpr int64_t kSector = 512;

std::string NewName() {
  static std::atomic<int> count{0};
  return absl::StrCat("simulated-", count++);
}

}  // namespace

SimulatedDisk::SimulatedDisk()
    : vfs_name_(NewName()), vfs_(MakeSimulatedVfs(*this, vfs_name_.c_str())) {
  auto root = std::make_shared<Node>();
  root->folder = true;
  names_["/"] = durable_names_["/"] = root;
  sqlite3_vfs_register(vfs_.get(), 0);
}

SimulatedDisk::~SimulatedDisk() { sqlite3_vfs_unregister(vfs_.get()); }

void SimulatedDisk::Inject(const Fault& fault) {
  MutexLock lock(mutex_);
  fault_ = fault;
  fault_->at += calls_;
}

void SimulatedDisk::LieAboutSyncsOf(Lie lie) {
  MutexLock lock(mutex_);
  lie_ = lie;
}

bool SimulatedDisk::Struck() const {
  MutexLock lock(mutex_);
  return fault_ && calls_ > fault_->at;
}

int64_t SimulatedDisk::calls() const {
  MutexLock lock(mutex_);
  return calls_;
}

int SimulatedDisk::Enter() {
  striking_.reset();
  const int64_t call = calls_++;
  if (!powered_) return -EIO;
  if (!fault_ || call != fault_->at) return 0;
  switch (fault_->kind) {
    case Fault::Kind::kError:
      return -fault_->error;
    case Fault::Kind::kPowerLoss:
      powered_ = false;
      return -EIO;
    case Fault::Kind::kShort:
    case Fault::Kind::kTorn:
      striking_ = fault_;
      return 0;
  }
  return 0;
}

void SimulatedDisk::SetSize(int64_t bytes) {
  MutexLock lock(mutex_);
  size_ = bytes;
}

int64_t SimulatedDisk::Used() const {
  MutexLock lock(mutex_);
  return UsedBytes();
}

int64_t SimulatedDisk::UsedBytes() const {
  std::set<const Node*> seen;
  int64_t bytes = 0;
  for (const auto& [name, node] : names_) {
    if (seen.insert(node.get()).second) {
      bytes += static_cast<int64_t>(node->now.size());
    }
  }
  return bytes;
}

void SimulatedDisk::CloseAll() {
  open_.clear();
  for (auto& [name, node] : names_) node->locked_by = 0;
}

void SimulatedDisk::EndProcess() {
  MutexLock lock(mutex_);
  fault_.reset();
  CloseAll();
}

void SimulatedDisk::Restart(uint64_t seed) {
  MutexLock lock(mutex_);
  std::mt19937_64 random(seed);
  // Between nearly nothing and nearly all.
  std::bernoulli_distribution kept(0.02 + 0.24 * static_cast<double>(seed % 5));
  for (const NameChange& change : pending_) {
    if (kept(random)) Apply(change, durable_names_);
  }
  pending_.clear();
  names_ = durable_names_;
  std::set<Node*> seen;
  for (auto& [name, node] : names_) {
    if (!seen.insert(node.get()).second) continue;
    for (const Write& write : node->pending) {
      if (kept(random)) Apply(write, node->durable);
    }
    node->pending.clear();
    node->now = node->durable;
  }
  CloseAll();
  fault_.reset();
  powered_ = true;
}

void SimulatedDisk::Apply(const NameChange& change, Names& names) {
  if (!change.gone.empty() && names.erase(change.gone) == 0) return;
  if (!change.made.empty()) names[change.made] = change.node;
}

void SimulatedDisk::Apply(const Write& write, std::string& contents) {
  if (write.offset < 0) {
    contents.resize(static_cast<size_t>(write.size));
    return;
  }
  const size_t end = static_cast<size_t>(write.offset) + write.data.size();
  if (contents.size() < end) contents.resize(end);
  std::memcpy(contents.data() + write.offset, write.data.data(),
              write.data.size());
}

void SimulatedDisk::Change(NameChange change) {
  Apply(change, names_);
  pending_.push_back(std::move(change));
}

std::shared_ptr<SimulatedDisk::Node> SimulatedDisk::Find(int file) {
  const auto found = open_.find(file);
  return found == open_.end() ? nullptr : found->second;
}

int SimulatedDisk::Open(const std::string& path, Access access) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  auto found = names_.find(path);
  if (found == names_.end()) {
    if (access == Access::kRead || !names_.contains(FolderOf(path))) {
      return -ENOENT;
    }
    Change({.made = path, .node = std::make_shared<Node>()});
    found = names_.find(path);
  } else if (access == Access::kCreate) {
    return -EEXIST;
  }
  if (found->second->folder && access != Access::kRead) return -EISDIR;
  open_[next_file_] = found->second;
  return next_file_++;
}

int SimulatedDisk::Close(int file) {
  MutexLock lock(mutex_);
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  if (node->locked_by == file) node->locked_by = 0;
  open_.erase(file);
  return Enter();
}

int64_t SimulatedDisk::Size(int file) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  return node == nullptr ? -EBADF : static_cast<int64_t>(node->now.size());
}

int64_t SimulatedDisk::ReadAt(int file, void* out, size_t size,
                              int64_t offset) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  if (striking_) {
    if (striking_->kind == Fault::Kind::kTorn) return -EIO;
    size = (size + 1) / 2;
  }
  if (offset >= static_cast<int64_t>(node->now.size())) return 0;
  size = std::min(size, node->now.size() - static_cast<size_t>(offset));
  std::memcpy(out, node->now.data() + offset, size);
  return static_cast<int64_t>(size);
}

int64_t SimulatedDisk::WriteAt(int file, const void* data, size_t size,
                               int64_t offset) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  const int64_t more = offset + static_cast<int64_t>(size) -
                       static_cast<int64_t>(node->now.size());
  if (more > 0 && UsedBytes() > size_ - more) return -ENOSPC;
  if (striking_) size = (size + 1) / 2;
  const char* bytes = static_cast<const char*>(data);
  for (size_t done = 0; done < size;) {
    const int64_t begin = offset + static_cast<int64_t>(done);
    const size_t part =
        std::min(size - done, static_cast<size_t>(kSector - begin % kSector));
    Write write{.offset = begin, .data = std::string(bytes + done, part)};
    Apply(write, node->now);
    node->pending.push_back(std::move(write));
    done += part;
  }
  if (striking_ && striking_->kind == Fault::Kind::kTorn) return -EIO;
  return static_cast<int64_t>(size);
}

int SimulatedDisk::Truncate(int file, int64_t size) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  if (striking_) return striking_->kind == Fault::Kind::kTorn ? -EIO : 0;
  Write write{.offset = -1, .size = size};
  Apply(write, node->now);
  node->pending.push_back(std::move(write));
  return 0;
}

int SimulatedDisk::Sync(int file) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  if (striking_ && striking_->kind == Fault::Kind::kTorn) return -EIO;
  if (lie_ == Lie::kFiles) return 0;
  node->durable = node->now;
  node->pending.clear();
  return 0;
}

int SimulatedDisk::Lock(int file) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  if (node->locked_by != 0 && node->locked_by != file) return -EWOULDBLOCK;
  node->locked_by = file;
  return 0;
}

int SimulatedDisk::Map(int file, int64_t size,
                       std::shared_ptr<const std::byte>& out) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto node = Find(file);
  if (node == nullptr) return -EBADF;
  // Aligned as pages are, so that what reads arrays may rely on it.
  const size_t pages = (static_cast<size_t>(size) + 4095) / 4096 * 4096;
  auto* copy = static_cast<std::byte*>(std::aligned_alloc(4096, pages));
  std::memcpy(copy, node->now.data(), static_cast<size_t>(size));
  out = std::shared_ptr<const std::byte>(copy, [](const std::byte* bytes) {
    std::free(const_cast<std::byte*>(bytes));
  });
  return 0;
}

int SimulatedDisk::Rename(const std::string& from, const std::string& to) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto found = names_.find(from);
  if (found == names_.end() || !names_.contains(FolderOf(to))) return -ENOENT;
  const auto node = found->second;
  if (!node->folder) {
    Change({.gone = from, .made = to, .node = node});
    return 0;
  }
  // What lies in a folder goes with it, at once: there are no entries of their
  // own for it on a disk.
  Change({.gone = from, .made = to, .node = node});
  for (Names* names : {&names_, &durable_names_}) {
    Names moved;
    for (const auto& [name, inner] : *names) {
      if (!absl::StartsWith(name, from + "/")) continue;
      moved[to + name.substr(from.size())] = inner;
    }
    std::erase_if(*names, [&](const auto& entry) {
      return absl::StartsWith(entry.first, from + "/");
    });
    names->merge(moved);
  }
  return 0;
}

int SimulatedDisk::Link(const std::string& from, const std::string& to) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto found = names_.find(from);
  if (found == names_.end() || !names_.contains(FolderOf(to))) return -ENOENT;
  if (names_.contains(to)) return -EEXIST;
  Change({.made = to, .node = found->second});
  return 0;
}

int SimulatedDisk::Unlink(const std::string& path) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  if (!names_.contains(path)) return -ENOENT;
  Change({.gone = path});
  return 0;
}

int SimulatedDisk::MakeDirectory(const std::string& path) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  if (names_.contains(path)) return -EEXIST;
  if (!names_.contains(FolderOf(path))) return -ENOENT;
  auto node = std::make_shared<Node>();
  node->folder = true;
  Change({.made = path, .node = node});
  return 0;
}

int SimulatedDisk::List(const std::string& directory,
                        std::vector<std::string>& names) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  const auto found = names_.find(directory);
  if (found == names_.end()) return -ENOENT;
  if (!found->second->folder) return -ENOTDIR;
  for (const auto& [name, node] : names_) {
    if (name == "/" || FolderOf(name) != directory) continue;
    names.push_back(name.substr(name.rfind('/') + 1));
  }
  return 0;
}

int SimulatedDisk::SyncDirectory(const std::string& directory) {
  MutexLock lock(mutex_);
  if (const int error = Enter()) return error;
  if (!names_.contains(directory)) return -ENOENT;
  if (lie_ == Lie::kNames) return 0;
  std::erase_if(pending_, [&](const NameChange& change) {
    const bool synced =
        (!change.gone.empty() && FolderOf(change.gone) == directory) ||
        (!change.made.empty() && FolderOf(change.made) == directory);
    if (synced) Apply(change, durable_names_);
    return synced;
  });
  return 0;
}

std::string SimulatedDisk::Contents(const std::string& path) const {
  MutexLock lock(mutex_);
  return names_.at(path)->now;
}

void SimulatedDisk::Replace(const std::string& path,
                            const std::string& contents) {
  MutexLock lock(mutex_);
  Node& node = *names_.at(path);
  node.now = node.durable = contents;
  node.pending.clear();
}

std::vector<std::string> SimulatedDisk::Files() const {
  MutexLock lock(mutex_);
  std::vector<std::string> files;
  for (const auto& [name, node] : names_) {
    if (!node->folder) files.push_back(name);
  }
  return files;
}

}  // namespace deform::server
