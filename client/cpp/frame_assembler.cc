#include "client/cpp/frame_assembler.h"

#include <algorithm>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/frames/normals.h"

namespace deform {
namespace {

template <typename... Parts>
absl::Status BadFrame(const Parts&... parts) {
  return InvalidInput("BAD_FRAME", "frame", absl::StrCat(parts...));
}

std::span<const uint8_t> BytesOf(const std::string& data) {
  return {reinterpret_cast<const uint8_t*>(data.data()), data.size()};
}

}  // namespace

absl::Status FrameAssembler::AddOrder(const v1::PointOrderChunk& chunk) {
  const auto bytes = BytesOf(chunk.data());
  const auto needed = static_cast<uint64_t>(point_count_) * sizeof(int32_t);
  if (order_ || chunk.first() != order_bytes_.size() / sizeof(int32_t) ||
      bytes.empty() || bytes.size() % sizeof(int32_t) != 0 ||
      bytes.size() > needed - order_bytes_.size()) {
    return InvalidInput(
        "BAD_POINT_ORDER", "point_order",
        absl::StrCat("the order goes on at point ", chunk.first(), " with ",
                     bytes.size(), " bytes, where ",
                     order_bytes_.size() / sizeof(int32_t), " of ",
                     point_count_, " points were reached",
                     order_ ? ": it was complete" : ""));
  }
  order_bytes_.insert(order_bytes_.end(), bytes.begin(), bytes.end());
  if (order_bytes_.size() < needed) return absl::OkStatus();
  DEFORM_ASSIGN_OR_RETURN(order_,
                          PointOrder::FromBytes(order_bytes_, point_count_));
  order_bytes_ = {};
  return absl::OkStatus();
}

void FrameAssembler::BeginBinding(std::string binding_id) {
  if (binding_id != binding_id_) held_pose_.reset();
  binding_id_ = std::move(binding_id);
}

absl::Status FrameAssembler::Begin(const v1::FrameChunk& chunk, Frame& frame) {
  if (chunk.origin_size() > 0) {
    if (chunk.origin_size() != dimension_) {
      return BadFrame("a frame's origin has ", chunk.origin_size(),
                      " numbers, not ", dimension_);
    }
    origin_.setZero();
    std::copy(chunk.origin().begin(), chunk.origin().end(), origin_.data());
    have_origin_ = true;
  }
  if (!have_origin_) return BadFrame("the first frame tells no origin");
  encoding_ = FindEncoding(chunk.encoding());
  if (encoding_ == nullptr) {
    return BadFrame("encoding \"", chunk.encoding(), "\" is not known");
  }
  refers_ = encoding_->refers() && !chunk.keyframe();
  if (encoding_->uses_grid()) DEFORM_RETURN_IF_ERROR(BeginOnGrid(chunk));
  if (encoding_->needs() == Needs::kWeights) {
    DEFORM_RETURN_IF_ERROR(
        CheckReference(chunk, held_pose_ ? std::optional(held_pose_->revision)
                                         : std::nullopt));
  }
  revision_ = chunk.revision();
  frame.revision = chunk.revision();
  frame.epoch = chunk.epoch();
  frame.durable_revision = chunk.durable_revision();
  frame.answers_sequence = chunk.answers_sequence();
  frame.dimension = dimension_;
  frame.origin = origin_;
  frame.positions.resize(point_count_ * dimension_);
  frame.normals.resize(normals_ ? 3 * point_count_ : 0);
  frame.skipped_revisions = chunk.skipped_revisions();
  frame.columns_applied = chunk.columns_applied();
  frame.exit_mismatch = chunk.exit_mismatch();
  frame.deform_us = chunk.deform_us();
  frame.encoding = chunk.encoding();
  frame.bytes = 0;
  frame.keyframe = chunk.keyframe();
  frame.error_bound = chunk.error_bound();
  if (chunk.has_basis_id()) basis_id_ = chunk.basis_id();
  frame.basis_id = basis_id_;
  return absl::OkStatus();
}

absl::Status FrameAssembler::BeginOnGrid(const v1::FrameChunk& chunk) {
  if (!order_) return BadFrame("the order of points has not come");
  DEFORM_RETURN_IF_ERROR(CheckReference(
      chunk, held_ ? std::optional(held_->revision) : std::nullopt));
  if (!CheckTolerance(chunk.step()).ok()) {
    return BadFrame("the grid has step ", chunk.step());
  }
  step_ = chunk.step();
  if (!grid_) grid_.emplace(point_count_);
  return absl::OkStatus();
}

absl::Status FrameAssembler::CheckReference(
    const v1::FrameChunk& chunk, std::optional<uint64_t> held) const {
  if (!refers_ || held == chunk.reference_revision()) return absl::OkStatus();
  return BadFrame("revision ", chunk.revision(), " refers to revision ",
                  chunk.reference_revision(), ", which is not held");
}

absl::Status FrameAssembler::CheckFollows(const v1::FrameChunk& chunk) const {
  if (chunk.revision() != revision_) {
    return BadFrame("revision ", chunk.revision(), " begins within revision ",
                    revision_);
  }
  if (chunk.encoding() != encoding_->id()) {
    return BadFrame("encoding \"", chunk.encoding(), "\" within one of \"",
                    encoding_->id(), "\"");
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> FrameAssembler::Add(const v1::FrameChunk& chunk,
                                         Frame& frame) {
  if (chunk.epoch() < newest_epoch_) return false;
  if (chunk.epoch() > newest_epoch_) {
    newest_epoch_ = chunk.epoch();
    next_vertex_ = 0;
    held_.reset();
    held_pose_.reset();
  }
  DEFORM_RETURN_IF_ERROR(next_vertex_ == 0 ? Begin(chunk, frame)
                                           : CheckFollows(chunk));
  const auto left = static_cast<uint64_t>(point_count_ - next_vertex_);
  if (chunk.first_vertex() != static_cast<uint64_t>(next_vertex_) ||
      chunk.vertex_count() > left ||
      (chunk.vertex_count() == 0 && !chunk.last())) {
    return BadFrame("a chunk holds vertices from ", chunk.first_vertex(),
                    " on, ", chunk.vertex_count(), " of them, where ",
                    next_vertex_, " of ", point_count_, " were reached");
  }
  DEFORM_RETURN_IF_ERROR(ReadNormals(chunk, frame));
  DEFORM_RETURN_IF_ERROR(Decode(chunk, frame));
  frame.bytes +=
      static_cast<int64_t>(chunk.data().size() + chunk.normals().size());
  next_vertex_ += static_cast<int64_t>(chunk.vertex_count());
  if (!chunk.last()) return false;
  if (next_vertex_ != point_count_) {
    return BadFrame("a frame ends after ", next_vertex_, " of ", point_count_,
                    " vertices");
  }
  if (encoding_->uses_grid()) FinishOnGrid(frame);
  next_vertex_ = 0;
  return true;
}

ChunkTarget FrameAssembler::TargetOf(const v1::FrameChunk& chunk,
                                     Frame& frame) const {
  const auto count = static_cast<int64_t>(chunk.vertex_count());
  ChunkTarget target{
      .dimension = dimension_,
      .first = next_vertex_,
      .count = count,
      .positions = std::span<float>(frame.positions)
                       .subspan(next_vertex_ * dimension_, count * dimension_),
      .origin = origin_,
      .error_bound = &frame.error_bound};
  if (weights_ == nullptr) return target;
  target.pool = weights_->pool();
  if (encoding_->needs() == Needs::kWeights) {
    target.deformer = weights_->Find(binding_id_);
    if (refers_) target.reference_pose = &held_pose_->pose;
  } else if (encoding_->needs() == Needs::kBasis) {
    target.basis = weights_->FindBasis(basis_id_);
  }
  return target;
}

absl::Status FrameAssembler::Decode(const v1::FrameChunk& chunk, Frame& frame) {
  if (encoding_->uses_grid()) {
    ChunkTarget target{.dimension = dimension_,
                       .first = next_vertex_,
                       .count = static_cast<int64_t>(chunk.vertex_count()),
                       .grid = &*grid_,
                       .reference = refers_ ? &held_->grid : nullptr};
    return encoding_->Decode(BytesOf(chunk.data()), target);
  }
  const ChunkTarget target = TargetOf(chunk, frame);
  DEFORM_RETURN_IF_ERROR(encoding_->Decode(BytesOf(chunk.data()), target));
  if (encoding_->needs() == Needs::kWeights) {
    held_pose_ = HeldPose{revision_, target.deformer->pose()};
  }
  return absl::OkStatus();
}

absl::Status FrameAssembler::ReadNormals(const v1::FrameChunk& chunk,
                                         Frame& frame) const {
  if (normals_) {
    return DecodeNormals(
        BytesOf(chunk.normals()),
        std::span<float>(frame.normals)
            .subspan(3 * next_vertex_, 3 * chunk.vertex_count()));
  }
  if (chunk.normals().empty()) return absl::OkStatus();
  return BadFrame("a chunk has normals, which were not asked for");
}

void FrameAssembler::FinishOnGrid(Frame& frame) {
  TakeOffGrid(*grid_, step_, *order_, dimension_, frame.positions);
  if (held_) {
    std::swap(held_->grid, *grid_);
  } else {
    held_ = Held{.grid = *std::exchange(grid_, std::nullopt)};
  }
  held_->revision = revision_;
}

}  // namespace deform
