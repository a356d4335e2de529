#include "client/cpp/frame_assembler.h"

#include <algorithm>
#include <span>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace deform {
namespace {

template <typename... Parts>
absl::Status BadFrame(const Parts&... parts) {
  return InvalidInput("BAD_FRAME", "frame", absl::StrCat(parts...));
}

}  // namespace

FrameAssembler::FrameAssembler(const FrameEncoding& encoding, int dimension,
                               int64_t point_count)
    : encoding_(encoding), dimension_(dimension), point_count_(point_count) {}

absl::Status FrameAssembler::Begin(const v1::FrameChunk& chunk, Frame& frame) {
  if (chunk.keyframe()) {
    if (chunk.origin_size() != dimension_) {
      return BadFrame("a keyframe's origin has ", chunk.origin_size(),
                      " numbers, not ", dimension_);
    }
    origin_.setZero();
    std::copy(chunk.origin().begin(), chunk.origin().end(), origin_.data());
    have_origin_ = true;
  }
  if (!have_origin_) return BadFrame("the first frame is no keyframe");
  revision_ = chunk.revision();
  frame.revision = chunk.revision();
  frame.epoch = chunk.epoch();
  frame.durable_revision = chunk.durable_revision();
  frame.answers_sequence = chunk.answers_sequence();
  frame.dimension = dimension_;
  frame.origin = origin_;
  frame.positions.resize(point_count_ * dimension_);
  frame.skipped_revisions = chunk.skipped_revisions();
  frame.columns_applied = chunk.columns_applied();
  frame.exit_mismatch = chunk.exit_mismatch();
  frame.deform_us = chunk.deform_us();
  return absl::OkStatus();
}

absl::StatusOr<bool> FrameAssembler::Add(const v1::FrameChunk& chunk,
                                         Frame& frame) {
  if (chunk.epoch() < newest_epoch_) return false;
  if (chunk.epoch() > newest_epoch_) {
    newest_epoch_ = chunk.epoch();
    next_vertex_ = 0;
  }
  if (next_vertex_ == 0) {
    DEFORM_RETURN_IF_ERROR(Begin(chunk, frame));
  } else if (chunk.revision() != revision_) {
    return BadFrame("revision ", chunk.revision(), " begins within revision ",
                    revision_);
  }
  const auto left = static_cast<uint64_t>(point_count_ - next_vertex_);
  if (chunk.first_vertex() != static_cast<uint64_t>(next_vertex_) ||
      chunk.vertex_count() > left ||
      (chunk.vertex_count() == 0 && !chunk.last())) {
    return BadFrame("a chunk holds vertices from ", chunk.first_vertex(),
                    " on, ", chunk.vertex_count(), " of them, where ",
                    next_vertex_, " of ", point_count_, " were reached");
  }
  const auto count = static_cast<int64_t>(chunk.vertex_count());
  DEFORM_RETURN_IF_ERROR(encoding_.Decode(
      {reinterpret_cast<const uint8_t*>(chunk.data().data()),
       chunk.data().size()},
      {.dimension = dimension_,
       .first = next_vertex_,
       .count = count,
       .positions =
           std::span<float>(frame.positions)
               .subspan(next_vertex_ * dimension_, count * dimension_)}));
  next_vertex_ += count;
  if (!chunk.last()) return false;
  if (next_vertex_ != point_count_) {
    return BadFrame("a frame ends after ", next_vertex_, " of ", point_count_,
                    " vertices");
  }
  next_vertex_ = 0;
  return true;
}

}  // namespace deform
