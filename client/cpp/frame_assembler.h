// Chunks in, frames out.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "client/cpp/deform_stream.h"
#include "core/frames/encoding.h"
#include "deform/v1/frame.pb.h"

namespace deform {

// Puts the chunks of one stream together. Not thread-safe.
class FrameAssembler {
 public:
  // `encoding` is exact and borrowed for ever (FindEncoding).
  FrameAssembler(const FrameEncoding& encoding, int dimension,
                 int64_t point_count);

  // Adds a chunk to `frame`, the same for all chunks of a frame. True if it
  // completed it. Chunks come from outside: InvalidArgument (BAD_FRAME) if they
  // do not follow each other, cover all points or decode. A frame of an epoch
  // older than one seen is dropped.
  absl::StatusOr<bool> Add(const v1::FrameChunk& chunk, Frame& frame);

 private:
  absl::Status Begin(const v1::FrameChunk& chunk, Frame& frame);

  const FrameEncoding& encoding_;
  const int dimension_;
  const int64_t point_count_;
  uint64_t newest_epoch_ = 0;
  int64_t next_vertex_ = 0;  // Vertices of the current frame so far.
  uint64_t revision_ = 0;    // Of the current frame.
  bool have_origin_ = false;
  Vec3 origin_ = Vec3::Zero();
};

}  // namespace deform
