// A model on its way in.
#pragma once

#include <cstdint>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/arrays.h"
#include "client/cpp/chunked_bytes.h"
#include "deform/v1/model.pb.h"

namespace deform {

// Takes what DownloadModel answers, in order. What cannot be is InvalidArgument
// BAD_ANSWER. Not thread-safe.
class ModelDownload {
 public:
  absl::Status Add(const v1::DownloadModelResponse& part);

  // Bytes, so far and at the end.
  int64_t received() const { return bytes_.received(); }
  int64_t total() const { return bytes_.total(); }

  absl::StatusOr<ModelArrays> Finish() &&;

 private:
  absl::Status Begin(const v1::Model& model);

  std::optional<v1::Model> model_;
  int64_t position_bytes_ = 0;
  ChunkedBytes bytes_{"model", 0};
};

}  // namespace deform
