#include "server/sessions/chunk_bytes.h"

#include <vector>

#include "core/base/mutex.h"
#include "core/frames/encoding.h"

namespace deform::server {
namespace {

class Kept {
 public:
  // Null if there is none.
  uint8_t* Take() {
    MutexLock lock(mutex_);
    if (free_.empty()) return nullptr;
    uint8_t* const bytes = free_.back().release();
    free_.pop_back();
    return bytes;
  }
  void Return(std::unique_ptr<uint8_t[]> bytes) {
    MutexLock lock(mutex_);
    if (free_.size() < kMostBytesKept / kMaxChunkBytes) {
      free_.push_back(std::move(bytes));
    }
  }

 private:
  Mutex mutex_;
  std::vector<std::unique_ptr<uint8_t[]>> free_ ABSL_GUARDED_BY(mutex_);
};

// Frames may outlive whatever there is: this one is never destroyed.
Kept& KeptBytes() {
  static Kept* const kept = new Kept;
  return *kept;
}

}  // namespace

void ReturnBytes::operator()(uint8_t* bytes) const {
  std::unique_ptr<uint8_t[]> own(bytes);
  if (kept) KeptBytes().Return(std::move(own));
}

ChunkBytes TakeChunkBytes() {
  uint8_t* bytes = KeptBytes().Take();
  if (bytes == nullptr) bytes = new uint8_t[kMaxChunkBytes];
  ReturnBytes back;
  back.kept = true;
  return {bytes, back};
}

}  // namespace deform::server
