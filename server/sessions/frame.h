// The deformed vertices of one revision as bytes, encoded once for all who
// receive the same.
#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/frames/encoding.h"
#include "core/frames/grid.h"
#include "core/frames/point_order.h"
#include "core/mesh/types.h"

namespace deform::server {

// What a frame says beside its bytes.
struct FrameInfo {
  uint64_t revision = 0;
  Vec3 origin = Vec3::Zero();
  // Counts the origins: a receiver that was told an older one needs the new.
  uint64_t origin_number = 0;
  int64_t columns_applied = 0;
  double exit_mismatch = 0;
  // How far compressed weights may have moved any point, in model units.
  double weight_error = 0;
  std::chrono::microseconds deform_time{0};
};

// How a receiver has its frames: settled when it joins (frame_wishes.h).
struct FrameFormat {
  const FrameEncoding* encoding = nullptr;
  double tolerance = 0;  // In model units; 0 if the encoding is exact.

  auto operator<=>(const FrameFormat&) const = default;
};

// A revision on a grid, as those hold it who received it. Immutable; travels as
// shared_ptr<const RevisionGrid>.
struct RevisionGrid {
  uint64_t revision = 0;
  double step = 0;
  Grid grid;
};

// Frames of a revision with the same key are the same bytes.
struct FrameKey {
  FrameFormat format;
  // What the receiver holds; null: a keyframe.
  std::shared_ptr<const RevisionGrid> reference;

  auto operator<=>(const FrameKey&) const = default;
};

// Normals of a revision (core/frames/normals.h), in the order of the model: two
// bytes a vertex, for all who want them, whatever their encoding. Immutable;
// travels as shared_ptr<const FrameNormals>.
using FrameNormals = std::vector<uint8_t>;

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
  // Not that of its key if that could not keep the tolerance: then float32.
  const FrameEncoding* encoding = nullptr;
  // How far compressed weights and the encoding may have moved any point, in
  // model units, beside roundings to float.
  double error_bound = 0;
  std::vector<Chunk> chunks;  // In order; at least one.

  // On a grid: what its receiver holds then, and in which order.
  std::shared_ptr<const RevisionGrid> grid;
  std::shared_ptr<const PointOrder> order;
  // None: a keyframe, which refers to no other.
  std::optional<uint64_t> reference_revision;
};

}  // namespace deform::server
