// Chunks of a download, as a server sends them.
#pragma once

#include <zlib.h>

#include <cstdint>
#include <string>

namespace deform {

// A part of DownloadModel or DownloadBasis.
template <typename Part>
Part ChunkOf(uint64_t offset, const std::string& data) {
  Part part;
  part.mutable_chunk()->set_offset(offset);
  part.mutable_chunk()->set_data(data);
  part.mutable_chunk()->set_crc32(static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(data.data()),
            static_cast<uInt>(data.size()))));
  return part;
}

}  // namespace deform
