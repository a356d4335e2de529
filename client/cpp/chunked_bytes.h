// Bytes on their way in, in chunks that follow each other.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace deform {

// Memory grows as bytes come. What cannot be is InvalidArgument BAD_ANSWER. Not
// thread-safe.
class ChunkedBytes {
 public:
  // `what` comes, of so many bytes.
  ChunkedBytes(std::string what, int64_t total)
      : what_(std::move(what)), total_(total) {}

  // A ModelChunk or BasisChunk.
  template <typename Chunk>
  absl::Status Add(const Chunk& chunk) {
    return Add(chunk.offset(), chunk.crc32(), chunk.data());
  }
  absl::Status CheckComplete() const;

  int64_t received() const { return static_cast<int64_t>(bytes_.size()); }
  int64_t total() const { return total_; }
  const std::string& bytes() const { return bytes_; }

 private:
  absl::Status Add(uint64_t offset, uint32_t sum, const std::string& data);

  std::string what_;
  int64_t total_;
  std::string bytes_;
};

// As it says that.
template <typename... Parts>
absl::Status BadDownload(const std::string& what, const Parts&... parts) {
  return InvalidInput("BAD_ANSWER", what, absl::StrCat(parts...));
}

}  // namespace deform
