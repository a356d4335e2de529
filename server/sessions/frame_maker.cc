#include "server/sessions/frame_maker.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/base/status_macros.h"
#include "core/frames/normals.h"

namespace deform::server {
namespace {

// Points whose places one thread takes in a row.
constexpr int64_t kCopiedTogether = 8192;

std::vector<float>& ThreadScratch() {
  static thread_local std::vector<float> scratch;
  return scratch;
}

// The memory as it is if the chunk fills most of it, else a copy.
ChunkBytes Fitted(ChunkBytes bytes, int64_t size) {
  if (size > kMaxChunkBytes / 2) return bytes;
  ChunkBytes fitted = std::make_unique_for_overwrite<uint8_t[]>(size);
  std::memcpy(fitted.get(), bytes.get(), size);
  return fitted;
}

// `source` but for the positions, if the encoding is one of these: of those of
// all points, unless these are empty.
absl::StatusOr<Frame::Chunk> EncodeChunk(const FrameEncoding& encoding,
                                         const Vec3& origin,
                                         std::span<const float> positions,
                                         ChunkSource source) {
  // Encodings may write up to a whole chunk, whatever they return.
  ChunkBytes bytes = TakeChunkBytes();
  const bool of_positions =
      !encoding.uses_grid() && encoding.needs() == Needs::kNothing;
  const int64_t numbers = source.count * source.dimension;
  if (of_positions && !positions.empty()) {
    source.positions =
        positions.subspan(source.first * source.dimension, numbers);
  } else if (of_positions) {
    auto* to = reinterpret_cast<float*>(bytes.get());
    if (!encoding.is_verbatim()) {
      ThreadScratch().resize(numbers);
      to = ThreadScratch().data();
    }
    source.deformer->CopyRelative(source.first, source.count, origin, to);
    source.positions = {to, static_cast<size_t>(numbers)};
  }
  DEFORM_ASSIGN_OR_RETURN(const int64_t size,
                          encoding.Encode(source, bytes.get()));
  return Frame::Chunk{.first_vertex = source.first,
                      .vertex_count = source.count,
                      .size = size,
                      .bytes = Fitted(std::move(bytes), size)};
}

// All points relative to `origin`, in parallel.
void CopyAll(const Deformer& deformer, const Vec3& origin, ThreadPool* pool,
             std::span<float> out) {
  const int64_t points = deformer.binding().point_count();
  const int dimension = deformer.binding().dimension();
  ParallelFor(pool, (points + kCopiedTogether - 1) / kCopiedTogether, nullptr,
              [&](int64_t block) {
                const int64_t first = block * kCopiedTogether;
                deformer.CopyRelative(first,
                                      std::min(kCopiedTogether, points - first),
                                      origin, out.data() + dimension * first);
              });
}

// Calls body(i) for i < count; the first error by i.
template <typename Body>
absl::Status ForEachChunk(int64_t count, ThreadPool* pool, Body body) {
  std::vector<absl::Status> statuses(count);
  const auto run = [&](int64_t i) { statuses[i] = body(i); };
  if (pool == nullptr || count == 1) {
    for (int64_t i = 0; i < count; ++i) run(i);
  } else {
    pool->ParallelFor(count, nullptr, run);
  }
  absl::Status first;
  for (const absl::Status& status : statuses) first.Update(status);
  return first;
}

}  // namespace

double FrameMaker::ShareOf(double tolerance, double weight_error) {
  if (weight_error == 0) return tolerance;
  return weight_error <= 0.25 * tolerance ? 0.75 * tolerance : 0.5 * tolerance;
}

void FrameMaker::Begin(const FrameInfo& info) {
  if (revision_ == info.revision) return;
  revision_ = info.revision;
  positions_.clear();
  grids_.clear();
  pose_.reset();
  normals_.reset();
}

Frames FrameMaker::Make(const Deformer& deformer, const FrameInfo& info,
                        std::span<const FrameKey> keys, ThreadPool* pool) {
  Begin(info);
  const FrameKey exact{.format = {.encoding = FindEncoding("float32")}};
  Frames frames;
  for (const FrameKey& key : keys) {
    if (frames.contains(key)) continue;
    auto frame = Encode(deformer, info, key, pool);
    if (!frame.ok()) {
      auto& instead = frames[exact];
      // Exact encodings take everything.
      if (instead == nullptr) {
        instead = Encode(deformer, info, exact, pool).value();
      }
      frame = instead;
    }
    frames[key] = *std::move(frame);
  }
  return frames;
}

std::shared_ptr<const FrameNormals> FrameMaker::Normals(
    const Deformer& deformer, const FrameInfo& info, ThreadPool* pool) {
  Begin(info);
  if (normals_ != nullptr) return normals_;
  if (fans_ == nullptr) fans_ = tables_->FansOf(deformer.binding().model());
  const int64_t points = deformer.binding().point_count();
  positions_.resize(3 * points);
  CopyAll(deformer, info.origin, pool, positions_);
  FrameNormals normals(kNormalBytes * points);
  fans_->EncodeNormals(positions_, normals, pool);
  normals_ = std::make_shared<const FrameNormals>(std::move(normals));
  return normals_;
}

std::shared_ptr<const HeldRevision> FrameMaker::PoseOf(const Deformer& deformer,
                                                       const FrameInfo& info) {
  if (pose_ == nullptr) {
    pose_ = std::make_shared<const HeldRevision>(
        HeldRevision{.revision = info.revision, .content = deformer.pose()});
  }
  return pose_;
}

absl::StatusOr<std::shared_ptr<const HeldRevision>> FrameMaker::GridOf(
    const Deformer& deformer, const FrameInfo& info, double step,
    ThreadPool* pool) {
  const auto made = grids_.find(step);
  if (made != grids_.end()) return made->second;
  if (order_ == nullptr) order_ = tables_->OrderOf(deformer.binding().model());
  const int64_t points = deformer.binding().point_count();
  const int dimension = deformer.binding().dimension();
  std::span<const float> positions = positions_;
  if (positions.empty()) {
    std::vector<float>& scratch = ThreadScratch();
    scratch.resize(points * dimension);
    CopyAll(deformer, info.origin, pool, scratch);
    positions = scratch;
  }
  DEFORM_ASSIGN_OR_RETURN(Grid grid,
                          PutOnGrid(positions, dimension, step, *order_, pool));
  auto held = std::make_shared<const HeldRevision>(HeldRevision{
      .revision = info.revision, .step = step, .content = std::move(grid)});
  grids_[step] = held;
  return held;
}

absl::StatusOr<std::shared_ptr<const Frame>> FrameMaker::Encode(
    const Deformer& deformer, const FrameInfo& info, const FrameKey& key,
    ThreadPool* pool) {
  const FrameEncoding& encoding = *key.format.encoding;
  const double share = ShareOf(key.format.tolerance, info.weight_error);
  auto frame = std::make_shared<Frame>();
  frame->info = info;
  frame->dimension = deformer.binding().dimension();
  frame->encoding = &encoding;
  frame->error_bound = info.weight_error + share;
  if (encoding.uses_grid()) {
    DEFORM_ASSIGN_OR_RETURN(frame->held, GridOf(deformer, info, share, pool));
    frame->order = order_;
  } else if (encoding.refers()) {
    frame->held = PoseOf(deformer, info);
  }
  if (key.reference) frame->reference_revision = key.reference->revision;
  ChunkSource source{.dimension = frame->dimension,
                     .tolerance = share,
                     .deformer = &deformer,
                     .basis = basis_ != nullptr ? basis_->basis.get() : nullptr,
                     .pool = pool};
  if (frame->held) source.grid = frame->held->grid();
  if (key.reference) {
    source.reference = key.reference->grid();
    source.reference_pose = key.reference->pose();
  }
  const int64_t points = deformer.binding().point_count();
  const int64_t per_chunk = encoding.PointsPerChunk(frame->dimension);
  const int64_t chunks = (points + per_chunk - 1) / per_chunk;
  frame->chunks.resize(chunks);
  DEFORM_RETURN_IF_ERROR(
      ForEachChunk(chunks, pool, [&](int64_t i) -> absl::Status {
        ChunkSource part = source;
        part.first = i * per_chunk;
        part.count = std::min(per_chunk, points - part.first);
        DEFORM_ASSIGN_OR_RETURN(
            frame->chunks[i],
            EncodeChunk(encoding, info.origin, positions_, part));
        return absl::OkStatus();
      }));
  return frame;
}

}  // namespace deform::server
