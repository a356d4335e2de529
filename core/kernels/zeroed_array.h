// Memory that vectors load well.
#pragma once

#include <sys/mman.h>

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <utility>

namespace deform {

// `size` zeros, at an address divisible by 64. Large ones cost nothing until
// they are written: calloc() leaves the zeroing to the system, page by page as
// threads first touch them. They ask for huge pages, which a walk over several
// tiles at once reads up to a fifth faster.
template <typename Number>
class ZeroedArray {
 public:
  static constexpr size_t kAlignment = 64;

  ZeroedArray() = default;
  explicit ZeroedArray(int64_t size) : size_(size) {
    if (size == 0) return;
    const size_t wanted = static_cast<size_t>(size) * sizeof(Number);
    size_t space = wanted + kAlignment;
    void* block = std::calloc(space, 1);
    if (block == nullptr) throw std::bad_alloc();
    void* aligned = block;
    std::align(kAlignment, wanted, aligned, space);
    data_ = std::unique_ptr<Number[], Free>(static_cast<Number*>(aligned),
                                            Free(block));
    if (wanted >= kWorthHugePages) AskForHugePages(aligned, wanted);
  }

  // `size` numbers of somebody else's, which stay as they are while `owner` or
  // a copy of it lives; aligned as ours. They are only to be read.
  static ZeroedArray Borrow(const Number* numbers, int64_t size,
                            std::shared_ptr<const void> owner) {
    ZeroedArray array;
    array.size_ = size;
    array.data_ = std::unique_ptr<Number[], Free>(
        const_cast<Number*>(numbers), Free(nullptr, std::move(owner)));
    return array;
  }

  int64_t size() const { return size_; }
  int64_t bytes() const { return size_ * int64_t{sizeof(Number)}; }
  const Number* data() const { return data_.get(); }
  Number* data() {
    assert(data_.get_deleter().lender == nullptr);
    return data_.get();
  }

 private:
  // Of the block in which the numbers lie aligned, or of whose they are.
  struct Free {
    Free() = default;
    explicit Free(void* b, std::shared_ptr<const void> l = nullptr)
        : block(b), lender(std::move(l)) {}
    void operator()(Number* /*data*/) const { std::free(block); }
    void* block = nullptr;
    std::shared_ptr<const void> lender;
  };

  static constexpr size_t kWorthHugePages = size_t{8} << 20;

  // Of the whole small pages within; a system without huge ones refuses, which
  // changes nothing.
  static void AskForHugePages(void* from, size_t bytes) {
    constexpr size_t kPage = 4096;
    void* page = from;
    if (std::align(kPage, kPage, page, bytes) == nullptr) return;
    madvise(page, bytes / kPage * kPage, MADV_HUGEPAGE);
  }

  int64_t size_ = 0;
  std::unique_ptr<Number[], Free> data_;
};

}  // namespace deform
