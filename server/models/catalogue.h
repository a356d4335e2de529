// What the server holds, by tenant and id: the one place for "not found", "in
// use", limits and pages.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/error.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "server/models/names.h"

namespace deform::server {

inline constexpr int kDefaultPageSize = 100;
inline constexpr int kMaxPageSize = 1000;

struct PageRequest {
  int size = kDefaultPageSize;
  std::string after;  // Last id of the page before; empty: the first page.
};

template <typename Record>
struct Page {
  std::vector<std::shared_ptr<Record>> records;  // Sorted by id.
  std::string next;  // `after` of the next page; empty on the last.
};

// Thread-safe; locks cover the map only. Outlives its leases.
template <typename Record>
class Catalogue {
  struct Entry {
    std::shared_ptr<Record> record;
    std::multiset<std::string> users;
    bool going = false;  // It is being removed: nobody finds it.
  };
  using Key = std::pair<std::string, std::string>;  // Tenant, id.

 public:
  using Pointer = std::shared_ptr<Record>;

  // While it lives, the record cannot be removed. Movable.
  class Lease {
   public:
    Lease() = default;
    Lease(Lease&& other) noexcept { *this = std::move(other); }
    Lease& operator=(Lease&& other) noexcept {
      std::swap(catalogue_, other.catalogue_);
      std::swap(key_, other.key_);
      std::swap(user_, other.user_);
      std::swap(record_, other.record_);
      return *this;
    }
    ~Lease() {
      if (catalogue_ != nullptr) catalogue_->Release(key_, user_);
    }
    const Pointer& record() const { return record_; }

   private:
    friend class Catalogue;
    Catalogue* catalogue_ = nullptr;
    Key key_;
    std::string user_;
    Pointer record_;
  };

  // `type` is "model", "binding" or "session"; at most `limit` records, which
  // the setting `option` says.
  Catalogue(absl::string_view type, int64_t limit, absl::string_view option)
      : type_(type), limit_(limit), option_(option) {}

  // The record that is there, or else `record`; second: whether one was there.
  // Never while one of this id is being removed. ResourceExhausted
  // TOO_MANY_<TYPE>S.
  absl::StatusOr<std::pair<Pointer, bool>> Insert(const std::string& tenant,
                                                  const std::string& id,
                                                  Pointer record) {
    MutexLock lock(mutex_);
    const auto found = entries_.find(Key(tenant, id));
    if (found != entries_.end()) return std::pair(found->second.record, true);
    if (static_cast<int64_t>(entries_.size()) >= limit_) {
      return MakeError(
          absl::StatusCode::kResourceExhausted,
          absl::StrCat("the server holds ", entries_.size(), " ", type_,
                       "s, its limit (", option_, ")"),
          {.reason = absl::StrCat("TOO_MANY_", Type(), "S"), .field = option_});
    }
    lost_.erase(Key(tenant, id));
    entries_[Key(tenant, id)].record = record;
    return std::pair(std::move(record), false);
  }

  // It was stored, and cannot be had: until another is inserted, who looks for
  // it is told `why`.
  void Lose(const std::string& tenant, const std::string& id,
            absl::Status why) {
    MutexLock lock(mutex_);
    lost_[Key(tenant, id)] = std::move(why);
  }

  // NotFound <TYPE>_NOT_FOUND, or why it was lost.
  absl::StatusOr<Pointer> Find(const std::string& tenant,
                               const std::string& id) const {
    MutexLock lock(mutex_);
    const auto found = entries_.find(Key(tenant, id));
    if (!IsThere(found)) return Missing(Key(tenant, id));
    return found->second.record;
  }

  // As Find(); `user` is who an attempt to remove it will be told: "session x".
  absl::StatusOr<Lease> Use(const std::string& tenant, const std::string& id,
                            std::string user) {
    MutexLock lock(mutex_);
    const auto found = entries_.find(Key(tenant, id));
    if (!IsThere(found)) return Missing(Key(tenant, id));
    found->second.users.insert(user);
    Lease lease;
    lease.catalogue_ = this;
    lease.key_ = found->first;
    lease.user_ = std::move(user);
    lease.record_ = found->second.record;
    return lease;
  }

  // Removes it once `forget`, called without the lock held, has done so in the
  // store; nobody finds it meanwhile. Null if it was lost. NotFound;
  // FailedPrecondition <TYPE>_IN_USE, which names a user; what `forget`
  // returns: then it stays.
  using Forget = absl::FunctionRef<absl::Status()>;
  absl::StatusOr<Pointer> Remove(const std::string& tenant,
                                 const std::string& id,
                                 Forget forget = NothingToForget) {
    const Key key(tenant, id);
    DEFORM_RETURN_IF_ERROR(BeginRemoval(key));
    const absl::Status forgotten = forget();
    MutexLock lock(mutex_);
    const auto found = entries_.find(key);
    if (!forgotten.ok()) {
      if (found != entries_.end()) found->second.going = false;
      return forgotten;
    }
    lost_.erase(key);
    if (found == entries_.end()) return Pointer();
    Pointer record = std::move(found->second.record);
    entries_.erase(found);
    return record;
  }

  // The tenant's records that `wanted` accepts.
  Page<Record> List(const std::string& tenant, const PageRequest& page,
                    absl::FunctionRef<bool(const Record&)> wanted) const {
    Page<Record> result;
    std::string last;
    MutexLock lock(mutex_);
    for (auto it = entries_.upper_bound(Key(tenant, page.after));
         it != entries_.end() && it->first.first == tenant; ++it) {
      if (!IsThere(it) || !wanted(*it->second.record)) continue;
      if (static_cast<int>(result.records.size()) == page.size) {
        result.next = last;
        break;
      }
      result.records.push_back(it->second.record);
      last = it->first.second;
    }
    return result;
  }

  // Of every tenant.
  int64_t size() const {
    MutexLock lock(mutex_);
    return static_cast<int64_t>(entries_.size());
  }

  // Every record of every tenant.
  std::vector<Pointer> All() const {
    std::vector<Pointer> all;
    MutexLock lock(mutex_);
    for (const auto& [key, entry] : entries_) all.push_back(entry.record);
    return all;
  }

 private:
  using Entries = std::map<Key, Entry>;

  static absl::Status NothingToForget() { return absl::OkStatus(); }

  bool IsThere(typename Entries::const_iterator found) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return found != entries_.end() && !found->second.going;
  }

  absl::Status BeginRemoval(const Key& key) {
    MutexLock lock(mutex_);
    const auto found = entries_.find(key);
    if (!IsThere(found)) {
      return lost_.contains(key) ? absl::OkStatus() : NotFound(key.second);
    }
    if (!found->second.users.empty()) {
      return InUse(key.second, found->second.users);
    }
    found->second.going = true;
    return absl::OkStatus();
  }

  absl::Status Missing(const Key& key) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    const auto lost = lost_.find(key);
    return lost == lost_.end() ? NotFound(key.second) : lost->second;
  }

  std::string Type() const { return absl::AsciiStrToUpper(type_); }

  absl::Status NotFound(const std::string& id) const {
    return MakeError(absl::StatusCode::kNotFound,
                     absl::StrCat("no ", type_, " ", Quoted(id)),
                     {.reason = absl::StrCat(Type(), "_NOT_FOUND"),
                      .resource_type = type_,
                      .resource_name = Printable(id)});
  }

  absl::Status InUse(const std::string& id,
                     const std::multiset<std::string>& users) const {
    std::string message =
        absl::StrCat(type_, " ", Quoted(id), " is used by ", *users.begin());
    if (users.size() > 1) {
      absl::StrAppend(&message, " and ", users.size() - 1, " more");
    }
    return MakeError(absl::StatusCode::kFailedPrecondition, message,
                     {.reason = absl::StrCat(Type(), "_IN_USE"),
                      .resource_type = type_,
                      .resource_name = id});
  }

  void Release(const Key& key, const std::string& user) {
    MutexLock lock(mutex_);
    auto& users = entries_.at(key).users;
    users.erase(users.find(user));
  }

  const std::string type_;
  const int64_t limit_;
  const std::string option_;
  mutable Mutex mutex_;
  Entries entries_ ABSL_GUARDED_BY(mutex_);
  std::map<Key, absl::Status> lost_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace deform::server
