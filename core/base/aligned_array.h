// Room for numbers that vectors load and store.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>

namespace deform {

// `count` numbers, aligned to 64 bytes and not set. Throws std::bad_alloc.
template <typename T>
class AlignedArray {
 public:
  explicit AlignedArray(int64_t count)
      : data_(static_cast<T*>(std::aligned_alloc(
            64, (static_cast<size_t>(count) * sizeof(T) + 63) / 64 * 64))) {
    if (data_ == nullptr && count > 0) throw std::bad_alloc();
  }
  T* get() const { return data_.get(); }
  T& operator[](int64_t i) const { return data_.get()[i]; }

 private:
  struct Free {
    void operator()(T* data) const { std::free(data); }
  };
  std::unique_ptr<T[], Free> data_;
};

}  // namespace deform
