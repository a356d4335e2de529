#include "client/cpp/chunked_bytes.h"

#include <zlib.h>

namespace deform {

absl::Status ChunkedBytes::Add(uint64_t offset, uint32_t sum,
                               const std::string& data) {
  if (offset != bytes_.size() || data.empty() ||
      static_cast<int64_t>(data.size()) > total_ - received()) {
    return BadDownload(what_, "a chunk of ", data.size(), " bytes comes at ",
                       offset, ", where ", received(), " of ", total_,
                       " bytes were reached");
  }
  const auto found = static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(data.data()),
            static_cast<uInt>(data.size())));
  if (found != sum) {
    return BadDownload(what_, "the chunk at ", offset,
                       " has another checksum than it tells");
  }
  bytes_ += data;
  return absl::OkStatus();
}

absl::Status ChunkedBytes::CheckComplete() const {
  if (received() == total_) return absl::OkStatus();
  return BadDownload(what_, "a ", what_, " ends after ", received(), " of ",
                     total_, " bytes");
}

}  // namespace deform
