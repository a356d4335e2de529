#include "server/stores/bytes.h"

#include <xxhash.h>

namespace deform::server {

uint64_t Checksum(std::span<const std::byte> bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

ByteReader ByteReader::Unseal(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  if (bytes.size() < sizeof(uint64_t)) {
    reader.ok_ = false;
    return reader;
  }
  const size_t size = bytes.size() - sizeof(uint64_t);
  ByteReader seal(bytes.subspan(size));
  reader.rest_ = bytes.first(size);
  reader.ok_ = seal.U64() == Checksum(reader.rest_);
  return reader;
}

}  // namespace deform::server
