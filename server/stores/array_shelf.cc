#include "server/stores/array_shelf.h"

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/array_file.h"
#include "server/stores/files.h"

namespace deform::server {
namespace {

// No key has a tilde in it.
constexpr absl::string_view kUnfinished = "~";

}  // namespace

std::string ModelFile(const StoreKey& model) {
  return absl::StrCat("models/", model.tenant, "/", model.id);
}

std::string WeightsFile(const StoreKey& binding, const WeightsForm& form) {
  return absl::StrCat("weights/", binding.tenant, "/", binding.id, ".",
                      form.name, "-", form.version);
}

bool IsWeightsFile(absl::string_view name) {
  return absl::StartsWith(name, "weights/");
}

ArrayShelf::Claim::~Claim() {
  if (shelf_ == nullptr) return;
  MutexLock lock(shelf_->mutex_);
  shelf_->claimed_.erase(name_);
  shelf_->changed_.NotifyAll();
}

ArrayShelf::Hold::Hold(ArrayShelf& shelf) : shelf_(shelf) {
  MutexLock lock(shelf_.mutex_);
  ++shelf_.holds_;
  while (shelf_.removals_ > 0) shelf_.changed_.Wait(shelf_.mutex_);
}

ArrayShelf::Hold::~Hold() {
  MutexLock lock(shelf_.mutex_);
  --shelf_.holds_;
}

absl::Status ArrayShelf::Prepare() {
  for (const char* folder : {"models", "weights", "quarantine"}) {
    DEFORM_RETURN_IF_ERROR(MakeDirectory(files_, PathOf(folder)));
  }
  return absl::OkStatus();
}

ArrayShelf::Claim ArrayShelf::Take(const std::string& name) {
  MutexLock lock(mutex_);
  while (!claimed_.insert(name).second) changed_.Wait(mutex_);
  return Claim(this, name);
}

absl::Status ArrayShelf::Write(const Claim& claim, const StoredArrays& arrays) {
  const std::string path = PathOf(claim.name());
  const std::string unfinished = absl::StrCat(path, kUnfinished);
  DEFORM_RETURN_IF_ERROR(MakeDirectory(files_, FolderOf(path)));
  DEFORM_RETURN_IF_ERROR(RemoveFile(files_, unfinished));
  absl::Status status =
      WriteArrayFile(files_, unfinished, claim.name(), arrays);
  if (status.ok()) status = RenameFile(files_, unfinished, path);
  // Room on a full disk; what cannot be removed now is an orphan.
  if (!status.ok()) RemoveFile(files_, unfinished).IgnoreError();
  return status;
}

absl::StatusOr<StoredArrays> ArrayShelf::Read(const Claim& claim) {
  absl::StatusOr<StoredArrays> arrays =
      ReadArrayFile(files_, PathOf(claim.name()), claim.name());
  if (!absl::IsDataLoss(arrays.status())) return arrays;
  return Quarantine(claim.name(), arrays.status());
}

absl::StatusOr<bool> ArrayShelf::Has(const Claim& claim) {
  return Exists(files_, PathOf(claim.name()));
}

absl::Status ArrayShelf::Quarantine(const std::string& name,
                                    const absl::Status& damage) {
  const std::string aside = absl::StrCat(
      root_, "/quarantine/", absl::StrReplaceAll(name, {{"/", "~"}}));
  DEFORM_RETURN_IF_ERROR(RenameFile(files_, PathOf(name), aside));
  return MakeError(damage.code(),
                   absl::StrCat(damage.message(), "; it is now ", aside),
                   DetailOf(damage));
}

absl::StatusOr<bool> ArrayShelf::RemoveOrphan(const std::string& name,
                                              Referred referred) {
  // Whoever writes an unfinished file has the claim of the finished one.
  const Claim claim = Take(std::string(absl::StripSuffix(name, kUnfinished)));
  DEFORM_ASSIGN_OR_RETURN(const bool wanted, referred(name));
  if (wanted) return false;
  // Finished while we waited for its claim, it has another name now.
  DEFORM_ASSIGN_OR_RETURN(const bool there, Exists(files_, PathOf(name)));
  if (!there) return false;
  {
    MutexLock lock(mutex_);
    if (holds_ > 0) return false;
    ++removals_;
  }
  const absl::Status removed = RemoveFile(files_, PathOf(name));
  MutexLock lock(mutex_);
  --removals_;
  changed_.NotifyAll();
  if (!removed.ok()) return removed;
  return true;
}

absl::StatusOr<int64_t> ArrayShelf::CollectOrphans(Referred referred) {
  DEFORM_ASSIGN_OR_RETURN(const std::vector<std::string> names, Names());
  int64_t removed = 0;
  for (const std::string& name : names) {
    DEFORM_ASSIGN_OR_RETURN(const bool gone, RemoveOrphan(name, referred));
    if (gone) ++removed;
  }
  return removed;
}

absl::StatusOr<std::vector<std::string>> ArrayShelf::Names() {
  std::vector<std::string> all;
  for (const std::string kind : {"models", "weights"}) {
    DEFORM_ASSIGN_OR_RETURN(const auto tenants,
                            ListDirectory(files_, PathOf(kind)));
    for (const std::string& tenant : tenants) {
      const std::string folder = absl::StrCat(kind, "/", tenant);
      DEFORM_ASSIGN_OR_RETURN(const auto names,
                              ListDirectory(files_, PathOf(folder)));
      for (const std::string& name : names) {
        all.push_back(absl::StrCat(folder, "/", name));
      }
    }
  }
  return all;
}

}  // namespace deform::server
