// Values as bytes, little-endian, sealed by a checksum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include "absl/strings/string_view.h"

namespace deform::server {

// XXH3, 64 bits: it tells bytes that changed by accident, one block in 2^64
// aside, as fast as memory is read. It protects from no one who means harm: who
// can write into the data directory can write anything.
uint64_t Checksum(std::span<const std::byte> bytes);

inline std::span<const std::byte> AsBytes(absl::string_view text) {
  return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}

class ByteWriter {
 public:
  ByteWriter& Add(uint64_t number) { return AddRaw(&number, sizeof(number)); }
  ByteWriter& Add(double number) { return AddRaw(&number, sizeof(number)); }
  ByteWriter& Add(absl::string_view text) {
    return Add(uint64_t{text.size()}).AddRaw(text.data(), text.size());
  }
  ByteWriter& AddRaw(const void* data, size_t size) {
    bytes_.append(static_cast<const char*>(data), size);
    return *this;
  }
  std::string Take() { return std::move(bytes_); }
  // With a checksum behind.
  std::string Seal() {
    Add(Checksum(AsBytes(bytes_)));
    return Take();
  }

 private:
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);
  std::string bytes_;
};

// Reads what a writer wrote. Whatever is missing reads as 0 or empty, and ok()
// is false from then on.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}
  // Not ok from the start if the seal is broken.
  static ByteReader Unseal(std::span<const std::byte> bytes);

  uint64_t U64() { return Number<uint64_t>(); }
  double Double() { return Number<double>(); }
  std::string String() {
    const uint64_t size = U64();
    const std::span<const std::byte> text = Raw(size);
    return std::string(reinterpret_cast<const char*>(text.data()), text.size());
  }
  // Empty if there are not so many.
  std::span<const std::byte> Raw(uint64_t size) {
    if (size > rest_.size()) ok_ = false;
    if (!ok_) return {};
    const auto raw = rest_.first(size);
    rest_ = rest_.subspan(size);
    return raw;
  }
  size_t left() const { return rest_.size(); }
  bool ok() const { return ok_; }
  // And nothing is left.
  bool done() const { return ok_ && rest_.empty(); }

 private:
  template <typename T>
  T Number() {
    T number = 0;
    const auto raw = Raw(sizeof(T));
    if (!raw.empty()) std::memcpy(&number, raw.data(), sizeof(T));
    return number;
  }

  std::span<const std::byte> rest_;
  bool ok_ = true;
};

}  // namespace deform::server
