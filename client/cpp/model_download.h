// A model on its way in.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/arrays.h"
#include "deform/v1/model.pb.h"

namespace deform {

// Takes what DownloadModel answers, in order. Memory grows as bytes come. What
// cannot be is InvalidArgument BAD_ANSWER. Not thread-safe.
class ModelDownload {
 public:
  absl::Status Add(const v1::DownloadModelResponse& part);

  // Bytes, so far and at the end.
  int64_t received() const { return static_cast<int64_t>(bytes_.size()); }
  int64_t total() const { return total_; }

  absl::StatusOr<ModelArrays> Finish() &&;

 private:
  absl::Status Begin(const v1::Model& model);

  std::optional<v1::Model> model_;
  int64_t position_bytes_ = 0;
  int64_t total_ = 0;
  std::string bytes_;
};

}  // namespace deform
