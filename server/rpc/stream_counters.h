// What the Deform streams have carried since the server's start.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace deform::server {

// Thread-safe: each count is right by itself, and costs one addition.
class StreamCounters {
 public:
  // `bytes` of one chunk's message; `last`: of its frame.
  void CountChunk(size_t bytes, bool last) {
    frame_bytes_.fetch_add(bytes, std::memory_order_relaxed);
    if (last) frames_.fetch_add(1, std::memory_order_relaxed);
  }
  void CountPose(bool accepted) {
    (accepted ? accepted_ : rejected_).fetch_add(1, std::memory_order_relaxed);
  }

  uint64_t frames() const { return frames_; }
  uint64_t frame_bytes() const { return frame_bytes_; }
  uint64_t poses_accepted() const { return accepted_; }
  uint64_t poses_rejected() const { return rejected_; }

 private:
  std::atomic<uint64_t> frames_{0};
  std::atomic<uint64_t> frame_bytes_{0};
  std::atomic<uint64_t> accepted_{0};
  std::atomic<uint64_t> rejected_{0};
};

}  // namespace deform::server
