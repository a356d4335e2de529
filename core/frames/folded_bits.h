// Whole numbers in few bits if they are small.
//
// A number is folded: 0, -1, 1, -2, 2 ... are told as f = 0, 1, 2, 3, 4 ...
// With a parameter k, about log2 of what is expected, f is told as f >> k bits
// of 0, a bit of 1, and the lowest k bits of f, lowest first. Bits fill bytes
// from the lowest on; the last byte is filled up with 0.
//
// Source: Rice, Plaunt, "Adaptive variable-length coding for efficient
// compression of spacecraft television data", IEEE Trans. Commun. Technol.
// 19(6), 1971.
#pragma once

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace deform {

inline constexpr int kMaxFoldedParameter = 31;

inline uint32_t Folded(int32_t number) {
  return (static_cast<uint32_t>(number) << 1) ^
         static_cast<uint32_t>(number >> 31);
}
inline int32_t Unfolded(uint32_t folded) {
  return static_cast<int32_t>((folded >> 1) ^ (0 - (folded & 1)));
}

// How many bits a number takes.
inline int64_t FoldedBits(int32_t number, int k) {
  return int64_t{Folded(number) >> k} + 1 + k;
}

class FoldedBitWriter {
 public:
  // Appends to `bytes`, which are borrowed; ends with Finish().
  explicit FoldedBitWriter(std::vector<uint8_t>& bytes) : bytes_(bytes) {}

  void Put(int32_t number, int k) {
    const uint32_t folded = Folded(number);
    for (uint32_t zeros = folded >> k; zeros > 0;) {
      const uint32_t some = std::min<uint32_t>(zeros, 32);
      PutBits(0, static_cast<int>(some));
      zeros -= some;
    }
    PutBits(1, 1);
    PutBits(folded & ((uint32_t{1} << k) - 1), k);
  }
  void Finish() { PutBits(0, (8 - count_) % 8); }

 private:
  // At most 32; fewer than 8 wait.
  void PutBits(uint64_t bits, int count) {
    waiting_ |= bits << count_;
    for (count_ += count; count_ >= 8; count_ -= 8, waiting_ >>= 8) {
      bytes_.push_back(static_cast<uint8_t>(waiting_));
    }
  }

  std::vector<uint8_t>& bytes_;
  uint64_t waiting_ = 0;
  int count_ = 0;
};

class FoldedBitReader {
 public:
  explicit FoldedBitReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  // False if the bits end, or tell more than 32 bits hold. 0 <= k <=
  // kMaxFoldedParameter.
  bool Take(int k, int32_t& number) {
    uint64_t zeros = 0;
    for (Fill(); waiting_ == 0; Fill()) {
      zeros += static_cast<uint64_t>(count_);
      if (bytes_.empty()) return false;
      count_ = 0;
    }
    const int last = std::countr_zero(waiting_);
    Drop(last + 1);
    zeros += static_cast<uint64_t>(last);
    if (zeros > std::numeric_limits<uint32_t>::max() >> k) return false;
    Fill();
    if (count_ < k) return false;
    const uint64_t low = waiting_ & ((uint64_t{1} << k) - 1);
    Drop(k);
    number = Unfolded(static_cast<uint32_t>(zeros << k | low));
    return true;
  }

  // Nothing is left but what fills up a byte.
  bool done() const { return bytes_.empty() && count_ < 8 && waiting_ == 0; }

 private:
  // To at least 56 bits, while there are any; those beyond are 0.
  void Fill() {
    while (count_ <= 56 && !bytes_.empty()) {
      waiting_ |= uint64_t{bytes_.front()} << count_;
      count_ += 8;
      bytes_ = bytes_.subspan(1);
    }
  }
  // At most 57.
  void Drop(int count) {
    waiting_ = count < 64 ? waiting_ >> count : 0;
    count_ -= count;
  }

  std::span<const uint8_t> bytes_;
  uint64_t waiting_ = 0;
  int count_ = 0;
};

}  // namespace deform
