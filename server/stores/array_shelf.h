// The files of large arrays, by name.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/mutex.h"
#include "server/stores/file_system.h"
#include "server/stores/records.h"

namespace deform::server {

// "models/<tenant>/<id>": where the file lies, and the address written into it.
std::string ModelFile(const StoreKey& model);
// "weights/<tenant>/<id>.<form>-<version>".
std::string WeightsFile(const StoreKey& binding, const WeightsForm& form);
bool IsWeightsFile(absl::string_view name);

// Thread-safe. A file appears whole or not at all, and never changes.
class ArrayShelf {
 public:
  // Whoever writes a file and then the row that refers to it, or removes both,
  // has the claim of its name meanwhile. Others wait.
  class Claim {
   public:
    Claim(Claim&& other) noexcept
        : shelf_(std::exchange(other.shelf_, nullptr)),
          name_(std::move(other.name_)) {}
    Claim& operator=(Claim&&) = delete;
    ~Claim();
    const std::string& name() const { return name_; }

   private:
    friend class ArrayShelf;
    Claim(ArrayShelf* shelf, std::string name)
        : shelf_(shelf), name_(std::move(name)) {}
    ArrayShelf* shelf_;
    std::string name_;
  };

  // `files` is borrowed. `root` is the data directory.
  ArrayShelf(FileSystem& files, std::string root)
      : files_(files), root_(std::move(root)) {}

  // Makes the folders.
  absl::Status Prepare();

  Claim Take(const std::string& name);

  absl::Status Write(const Claim& claim, const StoredArrays& arrays);
  // Verified and mapped. A damaged file is moved into quarantine/, and the
  // DataLoss says where to.
  absl::StatusOr<StoredArrays> Read(const Claim& claim);
  absl::StatusOr<bool> Has(const Claim& claim);

  // Nothing is removed while one of these lives.
  class Hold {
   public:
    explicit Hold(ArrayShelf& shelf);
    ~Hold();
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;

   private:
    ArrayShelf& shelf_;
  };

  // Removes the file unless somebody refers to it or removal is held up; what
  // stays is for CollectOrphans(). `referred` is asked with the name claimed.
  using Referred =
      absl::FunctionRef<absl::StatusOr<bool>(const std::string& name)>;
  absl::StatusOr<bool> RemoveOrphan(const std::string& name, Referred referred);
  // Of all files, those that nobody refers to.
  absl::StatusOr<int64_t> CollectOrphans(Referred referred);

 private:
  std::string PathOf(const std::string& name) const {
    return root_ + "/" + name;
  }
  absl::StatusOr<std::vector<std::string>> Names();
  absl::Status Quarantine(const std::string& name, const absl::Status& damage);

  FileSystem& files_;
  const std::string root_;
  Mutex mutex_;
  CondVar changed_;
  std::set<std::string> claimed_ ABSL_GUARDED_BY(mutex_);
  int holds_ ABSL_GUARDED_BY(mutex_) = 0;
  int removals_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace deform::server
