#include "server/models/memory_budget.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"

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

absl::StatusOr<MemoryBudget::Reservation> MemoryBudget::Reserve(
    int64_t bytes, absl::string_view what) {
  MutexLock lock(mutex_);
  if (bytes > limit_ - used_) {
    return MakeError(
        absl::StatusCode::kResourceExhausted,
        absl::StrCat(what, " ", FormatBytes(bytes), "; ", FormatBytes(used_),
                     " of ", FormatBytes(limit_), " (", option_,
                     ") are in use: delete what is no longer needed"),
        {.reason = "MEMORY_LIMIT", .field = option_});
  }
  used_ += bytes;
  return Reservation(this, bytes);
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
