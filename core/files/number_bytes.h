// Numbers in binary files, of either byte order.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace deform {

static_assert(std::endian::native == std::endian::little ||
              std::endian::native == std::endian::big);

template <typename T>
T LoadNumber(const char* bytes, bool big) {
  std::array<char, sizeof(T)> copy;
  std::memcpy(copy.data(), bytes, sizeof(T));
  if (big != (std::endian::native == std::endian::big)) {
    std::reverse(copy.begin(), copy.end());
  }
  return std::bit_cast<T>(copy);
}

template <typename T>
void StoreNumber(T value, bool big, char* bytes) {
  auto copy = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (big != (std::endian::native == std::endian::big)) {
    std::reverse(copy.begin(), copy.end());
  }
  std::memcpy(bytes, copy.data(), sizeof(T));
}

}  // namespace deform
