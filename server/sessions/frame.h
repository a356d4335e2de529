// The deformed vertices of one revision, encoded once for all who receive them.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/thread_pool.h"
#include "core/deform/deformer.h"
#include "core/frames/encoding.h"
#include "core/mesh/types.h"

namespace deform::server {

// What a frame says beside its bytes.
struct FrameInfo {
  uint64_t revision = 0;
  Vec3 origin = Vec3::Zero();
  // Counts the origins: a receiver that was told an older one needs a keyframe.
  uint64_t origin_number = 0;
  int64_t columns_applied = 0;
  double exit_mismatch = 0;
  std::chrono::microseconds deform_time{0};
};

// Immutable; travels as shared_ptr<const Frame>.
struct Frame {
  struct Chunk {
    int64_t first_vertex = 0;
    int64_t vertex_count = 0;
    int64_t size = 0;
    std::unique_ptr<uint8_t[]> bytes;
  };

  FrameInfo info;
  int dimension = 3;
  const FrameEncoding* encoding = nullptr;
  std::vector<Chunk> chunks;  // In order; at least one.
};

// Encodes where `deformer` is, chunks in parallel on `pool` (may be null), by
// an exact encoding: others need a tolerance.
std::shared_ptr<const Frame> EncodeFrame(const Deformer& deformer,
                                         const FrameEncoding& encoding,
                                         const FrameInfo& info,
                                         ThreadPool* pool);

}  // namespace deform::server
