// A leaf basis on its way in.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/chunked_bytes.h"
#include "client/cpp/deform_stream.h"
#include "deform/v1/binding.pb.h"

namespace deform {

// Takes what DownloadBasis answers, in order. What cannot be is InvalidArgument
// BAD_ANSWER. Not thread-safe.
class BasisDownload {
 public:
  absl::Status Add(const v1::DownloadBasisResponse& part);

  // Bytes, so far and at the end.
  int64_t received() const { return bytes_.received(); }
  int64_t total() const { return bytes_.total(); }

  // `known` if the server has it still, and sent no other.
  absl::StatusOr<HeldBasis> Finish(const HeldBasis& known) const;

 private:
  std::string id_;  // Empty: the header has not come.
  ChunkedBytes bytes_{"basis", 0};
};

}  // namespace deform
