#include "server/models/memory_budget.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/models/retry.h"

namespace deform::server {

std::string FormatBytes(int64_t bytes) {
  static constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB"};
  double value = static_cast<double>(bytes);
  int unit = 0;
  while (value >= 1024 && unit < 4) {
    value /= 1024;
    ++unit;
  }
  return absl::StrFormat("%.4g %s", value, kUnits[unit]);
}

MemoryBudget::Reservation::~Reservation() {
  if (budget_ != nullptr) budget_->Release(bytes_);
}

absl::Status MemoryBudget::Reservation::Resize(int64_t bytes,
                                               absl::string_view what) {
  if (budget_ == nullptr) return absl::OkStatus();
  if (bytes < bytes_) budget_->Release(bytes_ - bytes);
  if (bytes > bytes_) {
    DEFORM_RETURN_IF_ERROR(budget_->Take(bytes - bytes_, what));
  }
  bytes_ = bytes;
  return absl::OkStatus();
}

MemoryBudget::Reservation MemoryBudget::Reservation::Split(int64_t bytes) {
  const int64_t part = std::min(bytes, bytes_);
  bytes_ -= part;
  return Reservation(budget_, part);
}

absl::StatusOr<MemoryBudget::Reservation> MemoryBudget::Reserve(
    int64_t bytes, absl::string_view what) {
  DEFORM_RETURN_IF_ERROR(Take(bytes, what));
  return Reservation(this, bytes);
}

absl::Status MemoryBudget::Take(int64_t bytes, absl::string_view what) {
  for (;;) {
    const int64_t missing = TryTake(bytes);
    if (missing == 0) return absl::OkStatus();
    const int64_t reclaimable = reclaim_ ? reclaim_(missing) : 0;
    if (reclaimable >= missing) continue;  // Unless others were quicker.
    const absl::Status refused =
        MakeError(absl::StatusCode::kResourceExhausted,
                  absl::StrCat(what, " ", FormatBytes(bytes), "; ",
                               FormatBytes(used() - reclaimable), " of ",
                               FormatBytes(limit_), " (", option_,
                               ") are in use: delete what is no longer needed"),
                  {.reason = "MEMORY_LIMIT", .field = option_});
    return bytes <= limit_ ? RetryLater(refused) : refused;
  }
}

int64_t MemoryBudget::TryTake(int64_t bytes) {
  MutexLock lock(mutex_);
  if (bytes > limit_ - used_) return bytes - (limit_ - used_);
  used_ += bytes;
  return 0;
}

int64_t MemoryBudget::used() {
  MutexLock lock(mutex_);
  return used_;
}

void MemoryBudget::Release(int64_t bytes) {
  MutexLock lock(mutex_);
  used_ -= bytes;
}

}  // namespace deform::server
